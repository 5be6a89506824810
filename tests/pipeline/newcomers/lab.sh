# A lab with a display of its own, rehearsed (docs/guides/experimenter.md): 527 mm wide, seen from 0.7 m.
evenlight new rig desk.rig.toml --width-mm 527 --distance-m 0.7
sed -i.bak 's/^luminance_meter = "none"/luminance_meter = "simulated"/' desk.rig.toml
evenlight run luminance-sweep --session 01 --rig desk.rig.toml --simulate data --design quick --out panel
#: display desk (SIMULATED): gamma
#: The file of 'desk' no longer holds: peak
evenlight simulate ramp --participants 5 --display panel/sweeps/luminance-sweep_01/display.toml --out lab
evenlight fit lab --out calibration
#: simulated participants: 5 (
grep -q '"source": ".*5 simulated participants' calibration/rate_limit.json
# 2 atan(527 / 2 / 700) is 41.3 degrees
evenlight optimize film.mkv --budget 0.5 --rate-limit calibration/rate_limit.json --accept-wide-band --out film-track
#: film: analysed at 41.3°
#: savings unknown: no power model for desk (SIMULATED)
#: `evenlight run power-sweep` measures one
#: of the rate limit 'calibration' (yes_no, simulated)
#! borrowed
#! \d ?m?W\b
grep -q '"viewing_distance_m": 0.7' film-track/track.json
grep -q '"simulated": true' film-track/summary.json
evenlight validate desk.rig.toml
#: no problem
evenlight validate panel
#: no problem
evenlight validate calibration
#: no problem
evenlight validate film-track
#: no problem
