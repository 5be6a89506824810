# An engineer with a film and a laptop (docs/guides/engineer.md). `#:` is what must be read, `#!` what must not.
# Nothing is told in watts: nobody has measured those of this laptop.
evenlight optimize film.mkv --budget 0.5 --display laptop-lcd --other-display-ok --out film-track
#: film: analysed at 33.6°
#: mean brightness: 50 % (savings unknown: no power model for laptop-lcd)
#: rate limit borrowed: fitted on 'varjo-xr3', unproven on 'laptop-lcd'
#: film-track/player.html shows them in a browser
#! \d ?m?W\b
grep -q '"mean_power_w": null' film-track/summary.json
grep -q 'no power model for laptop-lcd' film-track/player.html
evenlight judge film.mkv film-track --no-modulation --out film-judged
#: equal loss is not yet equal quality
test -s film-judged/judgement.png
evenlight apply film.mkv film-track --out film-dimmed.mp4
#: film-dimmed.mp4: film, 6 frames, dimmed by its track
evenlight validate film-track
#: no problem
evenlight validate film-judged
#: no problem
