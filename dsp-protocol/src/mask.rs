//! The status mask: which groups of values a status message carries (`docs/protocol.md` section 4.1).

use std::fmt;

use crate::group::Group;

/// A set of [`Group`]s: the 16-bit status mask (`mascara`).
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StatusMask(pub u16);

impl StatusMask {
    /// No group: a status that carries the flying flag alone.
    pub const NONE: StatusMask = StatusMask(0);
    /// All sixteen groups.
    pub const ALL: StatusMask = StatusMask(u16::MAX);

    /// Whether `group` is in the set.
    pub const fn contains(self, group: Group) -> bool {
        self.0 & group.bit() != 0
    }

    /// The set with `group` added.
    #[must_use]
    pub const fn with(self, group: Group) -> StatusMask {
        StatusMask(self.0 | group.bit())
    }

    /// The set with `group` taken out.
    #[must_use]
    pub const fn without(self, group: Group) -> StatusMask {
        StatusMask(self.0 & !group.bit())
    }

    /// The groups of the set in the order of their bits.
    pub fn groups(self) -> impl Iterator<Item = Group> {
        Group::ALL
            .into_iter()
            .filter(move |group| self.contains(*group))
    }

    /// Length of a whole status frame of the classic profile with this mask, header and checksum included.
    pub const fn status_frame_len(self) -> usize {
        CLASSIC_OVERHEAD_LEN + self.status_payload_len()
    }

    /// Length of the payload of a status with this mask, the same in both profiles.
    pub(crate) const fn status_payload_len(self) -> usize {
        let [low, high] = self.0.to_le_bytes();
        MASK_AND_FLAGS_LEN
            + LOW_GROUPS_LEN[low as usize] as usize
            + HIGH_GROUPS_LEN[high as usize] as usize
    }
}

impl FromIterator<Group> for StatusMask {
    fn from_iter<I: IntoIterator<Item = Group>>(groups: I) -> Self {
        groups.into_iter().fold(StatusMask::NONE, StatusMask::with)
    }
}

impl fmt::Debug for StatusMask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "StatusMask({:#06x})", self.0)
    }
}

/// Header and checksum of a classic status.
const CLASSIC_OVERHEAD_LEN: usize = 2;
/// What every status has before its groups.
const MASK_AND_FLAGS_LEN: usize = 4;

// Summed once, since the decoder asks for the length of each frame.

/// Bytes of the groups 0 … 7, by the low half of a mask.
const LOW_GROUPS_LEN: [u8; 256] = groups_len(0);
/// Bytes of the groups 8 … 15, by the high half of a mask.
const HIGH_GROUPS_LEN: [u8; 256] = groups_len(8);

/// Bytes of eight groups from the group `first` on, for each subset of them.
const fn groups_len(first: usize) -> [u8; 256] {
    let mut lens = [0; 256];
    let mut subset = 1;
    while subset < lens.len() {
        // The subset without its lowest group has been summed already.
        let lowest = Group::ALL[first + subset.trailing_zeros() as usize];
        lens[subset] = lens[subset & (subset - 1)] + lowest.wire_len() as u8;
        subset += 1;
    }
    lens
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_stand_in_the_order_of_their_bits_and_have_names_of_their_own() {
        for (bit, group) in Group::ALL.into_iter().enumerate() {
            assert_eq!(group.bit(), 1 << bit);
            for other in &Group::ALL[..bit] {
                assert_ne!(group.name(), other.name());
            }
        }
    }

    #[test]
    fn a_mask_is_the_set_of_its_groups() {
        for bits in 0..=u16::MAX {
            let mask = StatusMask(bits);
            assert_eq!(mask.groups().collect::<StatusMask>(), mask);
            assert_eq!(mask.groups().count(), bits.count_ones() as usize);
        }
        for group in Group::ALL {
            assert_eq!(StatusMask::NONE.with(group).0, group.bit());
            assert_eq!(StatusMask::ALL.without(group).0, !group.bit());
            assert!(!StatusMask::ALL.without(group).contains(group));
        }
    }

    #[test]
    fn the_length_of_a_status_is_that_of_its_groups() {
        for bits in 0..=u16::MAX {
            let mask = StatusMask(bits);
            let groups: usize = mask.groups().map(Group::wire_len).sum();
            assert_eq!(mask.status_frame_len(), 6 + groups, "{mask:?}");
        }
        assert_eq!(StatusMask::NONE.status_frame_len(), 6);
        assert_eq!(StatusMask::ALL.status_frame_len(), 128);
    }
}
