//! The sixteen groups of a status: their layout (section 4.1), and values that can be (section 9).

use dsp_protocol::{Group, Status, StatusMask};

use crate::bench::Bench;
use crate::check::Check;
use crate::outcome::{Judged, ensure, not_judged};

/// The checks.
pub fn checks() -> Vec<Check> {
    let mut checks = Vec::new();
    for group in Group::ALL {
        let name = group.name();
        checks.push(Check::harmless(
            &format!("4.1-{name}"),
            "4.1",
            &format!("`{name}`"),
            &format!("a mask with the group {name} alone"),
            &format!(
                "statuses of {} bytes with this group and no other",
                StatusMask::NONE.with(group).status_frame_len()
            ),
            move |bench| async move { with_group(&bench, group).await.map(|_| ()) },
        ));
        if group != Group::Time {
            checks.push(Check::harmless(
                &format!("9-{name}"),
                "9",
                &format!("`{name}`"),
                &format!("a mask with the group {name} alone"),
                "ten statuses with values within the limits",
                move |bench| plausible(bench, group),
            ));
        }
    }
    checks.push(Check::harmless(
        "4.1-all-groups",
        "4.1",
        "A frame with all groups has 128 bytes.",
        "a mask with all groups",
        "statuses with all groups that the DSP has",
        |bench| async move {
            bench.set_mask(StatusMask::ALL).await?;
            bench.set_period(300).await?;
            let seen = bench.statuses(3).await?;
            let got = seen
                .last()
                .map_or(StatusMask::NONE, |(_, last)| last.mask());
            if got != StatusMask::ALL && got.contains(Group::Time) {
                let missing: Vec<&str> = StatusMask(!got.0).groups().map(Group::name).collect();
                return not_judged(format!(
                    "the DSP leaves out {}: it has no values for them",
                    missing.join(", ")
                ));
            }
            ensure(got == StatusMask::ALL, || {
                format!("a status came with mask 0x{:04X}", got.0)
            })
        },
    ));
    checks.push(Check::harmless(
        "4.1-specific-force",
        "4.1",
        "acceleration is the specific force that an accelerometer feels (at rest z ≈ −9.81 m/s²)",
        "a mask with the group acceleration alone",
        "on the ground, ten values of z of which the mean is −12 … −7.5 m/s²",
        |bench| async move {
            let seen = with_group(&bench, Group::Acceleration).await?;
            let mut z = seen.iter().filter_map(|status| status.acceleration);
            let (mut sum, mut count) = (0.0, 0.0_f32);
            for force in &mut z {
                sum += force.z_mps2;
                count += 1.0;
            }
            let mean = sum / count;
            ensure((-12.0..=-7.5).contains(&mean), || {
                format!("z is {mean:.2} m/s² while the helicopter stands")
            })
        },
    ));
    checks
}

/// Ten statuses that carry this group alone.
async fn with_group(bench: &Bench, group: Group) -> Judged<Vec<Status>> {
    let mask = StatusMask::NONE.with(group);
    bench.set_mask(mask).await?;
    // One of the old mask may have waited.
    bench.statuses(1).await?;
    let seen = bench.statuses(10).await?;
    for (_, status) in &seen {
        if status.mask() == StatusMask::NONE && group != Group::Time {
            return not_judged("the DSP leaves the group out: it has no values for it");
        }
        ensure(status.mask() == mask, || {
            format!(
                "a status came with mask 0x{:04X} where 0x{:04X} was asked for",
                status.mask().0,
                mask.0
            )
        })?;
    }
    Ok(seen.into_iter().map(|(_, status)| status).collect())
}

async fn plausible(bench: Bench, group: Group) -> Judged {
    for status in with_group(&bench, group).await? {
        ensure(!status.implausible_groups().contains(group), || {
            format!("the PC rejects the group: {}", values(&status, group))
        })?;
    }
    Ok(())
}

/// The values of a group in words.
fn values(status: &Status, group: Group) -> String {
    let mut only = *status;
    only.retain(StatusMask::NONE.with(group));
    // The group's own text, without the fields that are not there.
    let text = format!("{only:?}");
    let some = text.split("Some(").nth(1).unwrap_or(&text);
    some.split(')').next().unwrap_or(some).to_owned()
}
