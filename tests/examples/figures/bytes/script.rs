//! What a fuzz target does with its input. The corpus under `workbench/fuzz/corpus` is played by the tests as well.
//!
//! A script for the core is a byte for the profile, and then, as long as there is more:
//!
//! | first byte | what follows | meaning |
//! |---|---|---|
//! | `0x00` … `0x1F` | 8 bytes | the operator, the port or the clock: [`Core::act`] with that value |
//! | `0x20` … `0x3F` | | so many periods with a DSP that obliges, on a line that is sound |
//! | `0x40` … `0x7F` | so many bytes | they come over the line |
//! | `0x80` … | 7 bytes | all eight come over the line: a header and what follows |

use std::time::Duration;

use dsp_protocol::Profile;

use super::core::Core;
use super::decoders::Decoders;
use super::obliging::STATUS_PERIOD_MS;

/// Steps of one script at the most, so that none takes long.
const MOST_STEPS: usize = 4_096;

/// Gives `data` to the decoders.
pub fn decode(data: &[u8]) {
    Decoders::new().hear(data);
}

/// Plays `data` as a script for the core; every request must have its final report in the end.
pub fn play(data: &[u8]) {
    let Some((first, mut rest)) = data.split_first() else {
        return;
    };
    let mut core = Core::new(Profile::ALL[usize::from(first & 1)]);
    let mut line = Vec::new();
    for _ in 0..MOST_STEPS {
        let Some((op, after)) = rest.split_first() else {
            break;
        };
        let value = usize::from(op & 0x1F);
        rest = match op {
            0x00..=0x1F => {
                let (bytes, after) = after.split_at(after.len().min(8));
                let mut value = [0; 8];
                value[..bytes.len()].copy_from_slice(bytes);
                core.act(*op, u64::from_le_bytes(value));
                after
            }
            0x20..=0x3F => {
                for _ in 0..=value {
                    line.clear();
                    core.listen(&mut line);
                    core.receive(&line);
                    core.advance(Duration::from_millis(STATUS_PERIOD_MS.into()));
                }
                after
            }
            0x40..=0x7F => {
                let (bytes, after) = after.split_at(after.len().min(value + 1));
                core.receive(bytes);
                after
            }
            0x80.. => {
                let (bytes, after) = rest.split_at(rest.len().min(8));
                core.receive(bytes);
                after
            }
        };
    }
    core.finish();
}
