//! What comes over a bad line: noise, and frames that were damaged on the way.

use dsp_protocol::{Downlink, Profile, Uplink};

use super::random::Random;
use super::traffic::Traffic;

/// Appends bytes that mean nothing.
pub fn noise(count: usize, random: &mut Random, out: &mut Vec<u8>) {
    for _ in 0..count.div_ceil(8) {
        out.extend_from_slice(&random.bits().to_le_bytes());
    }
}

/// Appends a good frame of either direction and profile.
pub fn frame(random: &mut Random, out: &mut Vec<u8>) {
    let profile = Profile::ALL[random.below(2)];
    let frame = if random.once_in(3) {
        Uplink::random(random).frame(profile, random)
    } else {
        Downlink::random(random).frame(profile, random)
    };
    out.extend_from_slice(frame.as_bytes());
}

/// Damages one byte in `one_in` on average: flips a bit or all, loses it, sends it twice, puts another before it, or
/// cuts out what follows. `spare` is only there to keep its memory.
pub fn damage(one_in: usize, random: &mut Random, bytes: &mut Vec<u8>, spare: &mut Vec<u8>) {
    spare.clear();
    let mut index = 0;
    while let Some(byte) = bytes.get(index) {
        index += 1;
        if !random.once_in(one_in) {
            spare.push(*byte);
            continue;
        }
        let bits = random.bits();
        match bits & 7 {
            0 => {}
            1 => spare.extend([*byte, *byte]),
            2 => spare.extend([(bits >> 8) as u8, *byte]),
            3 => spare.push((bits >> 8) as u8),
            4 => index += (bits >> 8) as usize % 32,
            _ => spare.push(byte ^ (1 << ((bits >> 8) & 7))),
        }
    }
    std::mem::swap(bytes, spare);
}
