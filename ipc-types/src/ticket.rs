//! A bounded table whose keys know when what they stood for is gone. A pure value.

/// Stands for an open request at its server. A copy of it stays valid until the request's final report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ticket {
    index: u32,
    /// Counts how often the slot was given out, so that an old ticket never means a new request.
    generation: u32,
}

impl Ticket {
    /// The ticket as a number, for a core that only compares and returns it.
    pub const fn to_bits(self) -> u64 {
        (self.generation as u64) << 32 | self.index as u64
    }

    /// The ticket that [`Ticket::to_bits`] gave as a number. One that was never given stands for no request.
    pub const fn from_bits(bits: u64) -> Ticket {
        Ticket {
            index: bits as u32,
            generation: (bits >> 32) as u32,
        }
    }
}

/// The slots that tickets stand for.
#[derive(Debug)]
pub(crate) struct Tickets<E> {
    slots: Vec<Slot<E>>,
    /// Free slots, the one to use next last.
    free: Vec<u32>,
}

#[derive(Debug)]
struct Slot<E> {
    generation: u32,
    entry: Option<E>,
}

impl<E> Tickets<E> {
    /// A table of `capacity` slots; it never grows.
    pub(crate) fn with_capacity(capacity: u32) -> Tickets<E> {
        Tickets {
            slots: (0..capacity)
                .map(|_| Slot {
                    generation: 0,
                    entry: None,
                })
                .collect(),
            free: (0..capacity).rev().collect(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.slots.len() - self.free.len()
    }

    /// Takes a slot, or gives the entry back when there is none.
    pub(crate) fn insert(&mut self, entry: E) -> Result<Ticket, E> {
        let Some(index) = self.free.pop() else {
            return Err(entry);
        };
        let slot = &mut self.slots[index as usize];
        slot.entry = Some(entry);
        Ok(Ticket {
            index,
            generation: slot.generation,
        })
    }

    pub(crate) fn get(&self, ticket: Ticket) -> Option<&E> {
        let slot = self.slots.get(ticket.index as usize)?;
        slot.entry
            .as_ref()
            .filter(|_| slot.generation == ticket.generation)
    }

    pub(crate) fn get_mut(&mut self, ticket: Ticket) -> Option<&mut E> {
        let slot = self.slots.get_mut(ticket.index as usize)?;
        slot.entry
            .as_mut()
            .filter(|_| slot.generation == ticket.generation)
    }

    pub(crate) fn remove(&mut self, ticket: Ticket) -> Option<E> {
        self.get(ticket)?;
        let slot = self.slots.get_mut(ticket.index as usize)?;
        slot.generation = slot.generation.wrapping_add(1);
        self.free.push(ticket.index);
        slot.entry.take()
    }

    pub(crate) fn entries_mut(&mut self) -> impl Iterator<Item = &mut E> {
        self.slots.iter_mut().filter_map(|slot| slot.entry.as_mut())
    }

    /// Removes the entries that `leaves` says so of, and hands each on.
    pub(crate) fn remove_where(
        &mut self,
        mut leaves: impl FnMut(&mut E) -> bool,
        mut left: impl FnMut(Ticket, E),
    ) {
        if self.len() == 0 {
            return;
        }
        for (index, slot) in (0_u32..).zip(&mut self.slots) {
            if !slot.entry.as_mut().is_some_and(&mut leaves) {
                continue;
            }
            if let Some(entry) = slot.entry.take() {
                let ticket = Ticket {
                    index,
                    generation: slot.generation,
                };
                slot.generation = slot.generation.wrapping_add(1);
                self.free.push(index);
                left(ticket, entry);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_old_ticket_never_means_a_new_request() {
        let mut tickets = Tickets::with_capacity(1);
        let old = tickets.insert("old").unwrap();
        assert_eq!(tickets.remove(old), Some("old"));
        let new = tickets.insert("new").unwrap();
        assert_ne!(old, new);
        assert_eq!(tickets.get(old), None);
        assert_eq!(tickets.remove(old), None);
        assert_eq!(tickets.get_mut(new), Some(&mut "new"));
    }

    #[test]
    fn a_full_table_gives_the_entry_back() {
        let mut tickets = Tickets::with_capacity(2);
        tickets.insert(1).unwrap();
        let second = tickets.insert(2).unwrap();
        assert_eq!(tickets.insert(3), Err(3));
        assert_eq!(tickets.len(), 2);
        tickets.remove(second);
        assert!(tickets.insert(3).is_ok());
    }

    #[test]
    fn an_entry_that_leaves_is_handed_on_with_its_ticket() {
        let mut tickets = Tickets::with_capacity(4);
        let given: Vec<_> = (0..4).map(|n| tickets.insert(n).unwrap()).collect();
        let mut left = Vec::new();
        tickets.remove_where(|n| *n % 2 == 1, |ticket, n| left.push((ticket, n)));
        assert_eq!(left, [(given[1], 1), (given[3], 3)]);
        assert_eq!(tickets.len(), 2);
        assert_eq!(tickets.get(given[1]), None);
        assert_eq!(tickets.get(given[2]), Some(&2));
    }
}
