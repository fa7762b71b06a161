//! What comes over a bad line: noise, and frames that were damaged on the way.

use dsp_protocol::{Downlink, Profile, Uplink};
use fastrand::Rng;

use super::traffic::Traffic;

/// Appends bytes that mean nothing.
pub fn noise(count: usize, random: &mut Rng, out: &mut Vec<u8>) {
    out.extend((0..count).map(|_| random.u8(..)));
}

/// Appends a good frame of either direction and profile.
pub fn frame(random: &mut Rng, out: &mut Vec<u8>) {
    let profile = random.choice(Profile::ALL).unwrap();
    let frame = if random.usize(..3) == 0 {
        Uplink::random(random).frame(profile, random)
    } else {
        Downlink::random(random).frame(profile, random)
    };
    out.extend_from_slice(frame.as_bytes());
}

/// Damages one byte in `one_in` on average: flips a bit or all, loses it, sends it twice, puts another before it, or
/// cuts out what follows. `spare` is only there to keep its memory.
pub fn damage(one_in: usize, random: &mut Rng, bytes: &mut Vec<u8>, spare: &mut Vec<u8>) {
    spare.clear();
    let mut index = 0;
    while let Some(byte) = bytes.get(index) {
        index += 1;
        if random.usize(..one_in) > 0 {
            spare.push(*byte);
            continue;
        }
        let bits = random.u64(..);
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
