"""Plots a recorded flight: plot_flight.py FLIGHT.mcap [PICTURE.png]

It is written like a notebook: editors that know `# %%` run it cell by cell. It needs `pip install 'hero_ril[flight]' matplotlib`.
"""

# %% The flight
import sys

import hero_ril
import matplotlib.pyplot as plt

flight = hero_ril.Flight(sys.argv[1])
print(flight.topics)
for problem in flight.problems:
    print(f"warning: {problem}", file=sys.stderr)

# %% A frame for each topic, by time. What was not measured is NaN, so it leaves a gap in a plot.
telemetry = flight["hero/telemetry"]
units = telemetry.attrs["units"]
seconds = (telemetry.index - flight.start).total_seconds()
is_flying = telemetry["flying"] == 1
print(f"{is_flying.sum() / max(len(telemetry), 1):.0%} of {len(telemetry)} samples were taken in the air")

# %% Four plots
figure, ((track, altitude), (speed, battery)) = plt.subplots(2, 2, figsize=(11, 7), layout="constrained")
figure.suptitle(f"Robot {flight.metadata.get('ril.file', {}).get('robot', '?')}, {flight.start:%Y-%m-%d %H:%M:%S} UTC")

track.plot(telemetry["local.east_m"], telemetry["local.north_m"])
track.set(title="Track", xlabel="east [m]", ylabel="north [m]", aspect="equal")

for column, axes, title in [
    ("geodetic.altitude_m", altitude, "Altitude"),
    ("velocity.ground_speed_mps", speed, "Speed over ground"),
    ("supply.battery_v", battery, "Battery"),
]:
    axes.plot(seconds, telemetry[column])
    axes.fill_between(seconds, 0, 1, where=is_flying, transform=axes.get_xaxis_transform(), alpha=0.1, label="in the air")
    axes.set(title=title, xlabel="time [s]", ylabel=f"[{units[column]}]")

# %% Requests and what happened to the recording, where they happened
for frame, color, label in [
    (flight.requests, "tab:green", "requests and reports"),
    (flight.events, "tab:red", "events of the recording"),
]:
    for i, time in enumerate(frame.index):
        altitude.axvline((time - flight.start).total_seconds(), color=color, linewidth=0.8, label=label if i == 0 else None)
altitude.legend()

# %% On the screen, or into a file
if len(sys.argv) > 2:
    figure.savefig(sys.argv[2], dpi=120)
else:
    plt.show()
