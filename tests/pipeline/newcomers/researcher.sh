# A researcher with a table that Excel has written where a comma is decimal (docs/guides/researcher.md).
evenlight import answers.csv --task rating --out study
#: 5 participants
evenlight analyze study --figures svg --out results
#: The track was rated 1.20 points higher than constant dimming (n = 5, p = 0.12).
#! simulated
grep -q '<text' results/rating.svg
grep -q 'rated 1.20 points higher' results/report.html
test -s results/rating_statistics.csv
evenlight validate study
#: no problem
evenlight validate results
#: no problem
