//! [`Ticket`]: stands for an open request at its server. [`Tickets`]: the requests that have one.

/// Stands for an open request at its server. A copy of it stays valid until the request's final report, and never
/// stands for another request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(u64);

impl Ticket {
    /// The ticket as a number, for a core that only compares and returns it.
    pub fn to_bits(self) -> u64 {
        self.0
    }

    /// The ticket that [`Ticket::to_bits`] gave as a number. One that was never given stands for no request.
    pub const fn from_bits(bits: u64) -> Ticket {
        Ticket(bits)
    }
}

/// What has a ticket, in the order in which the tickets were given: each is one more than the last. Has room for a
/// fixed number, and does not allocate until there are more.
pub(crate) struct Tickets<T> {
    last: u64,
    entries: Vec<(Ticket, T)>,
}

impl<T> Tickets<T> {
    /// With room for `capacity` entries.
    pub(crate) fn with_capacity(capacity: usize) -> Tickets<T> {
        Tickets {
            last: 0,
            entries: Vec::with_capacity(capacity),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub(crate) fn insert(&mut self, entry: T) -> Ticket {
        self.last += 1;
        self.entries.push((Ticket(self.last), entry));
        Ticket(self.last)
    }

    pub(crate) fn get(&self, ticket: Ticket) -> Option<&T> {
        self.place(ticket).map(|place| &self.entries[place].1)
    }

    pub(crate) fn get_mut(&mut self, ticket: Ticket) -> Option<&mut T> {
        let place = self.place(ticket)?;
        Some(&mut self.entries[place].1)
    }

    pub(crate) fn remove(&mut self, ticket: Ticket) {
        if let Some(place) = self.place(ticket) {
            self.entries.remove(place);
        }
    }

    pub(crate) fn retain(&mut self, mut keep: impl FnMut(Ticket, &mut T) -> bool) {
        self.entries
            .retain_mut(|(ticket, entry)| keep(*ticket, entry));
    }

    pub(crate) fn values(&self) -> impl Iterator<Item = &T> {
        self.entries.iter().map(|(_, entry)| entry)
    }

    pub(crate) fn values_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.entries.iter_mut().map(|(_, entry)| entry)
    }

    fn place(&self, ticket: Ticket) -> Option<usize> {
        self.entries
            .binary_search_by_key(&ticket, |(of, _)| *of)
            .ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ticket_stands_for_one_entry_and_for_nothing_after_it() {
        let mut tickets = Tickets::with_capacity(4);
        let given = ["one", "two", "three", "four"].map(|entry| tickets.insert(entry));
        tickets.remove(given[1]);
        tickets.retain(|ticket, entry| ticket != given[2] && *entry != "one");
        let five = tickets.insert("five");
        assert!(!given.contains(&five));
        let found = given.map(|ticket| tickets.get(ticket).copied());
        assert_eq!(found, [None, None, None, Some("four")]);
        assert_eq!(tickets.get(five), Some(&"five"));
        assert_eq!(tickets.get(Ticket::from_bits(0)), None);
        tickets.remove(given[0]);
        assert_eq!((tickets.len(), tickets.values().count()), (2, 2));
    }
}
