//! [`Domain::repair`]: mends what is provably broken, at once, for an operator who does not want to wait for the next
//! process that does.

use super::lock::{DomainLock, MakingLock};
use super::{Cleaning, Domain, DomainError, Removal, dead, management};

/// What [`Domain::repair`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Repair {
    /// What became of the domain as a whole. The rest is only done when it is in use.
    pub removal: Removal,
    /// What was removed of dead processes beside the live ones.
    pub cleaning: Cleaning,
    /// The management segment was open to other users, and was replaced by a private one.
    pub secured: bool,
    /// The management segment kept nodes from being made, and was removed; the next node makes a new one.
    pub renewed: bool,
}

impl Domain {
    /// Removes the whole domain when no live process uses it. Otherwise removes what dead processes left in it, and
    /// mends the management segment; the live ones notice nothing of that.
    ///
    /// # Errors
    ///
    /// When the root or the management segment belongs to another user, or something cannot be removed.
    pub fn repair(&self) -> Result<Repair, DomainError> {
        let mut repair = Repair {
            removal: self.remove_if_dead()?,
            cleaning: Cleaning::default(),
            secured: false,
            renewed: false,
        };
        if repair.removal == Removal::InUse {
            let lock = DomainLock::acquire(self)?;
            let result = self.mend(&mut repair);
            lock.release(self);
            result?;
        }
        Ok(repair)
    }

    fn mend(&self, repair: &mut Repair) -> Result<(), DomainError> {
        let making = MakingLock::share(self);
        if !self.is_isolated() {
            self.set_global_config()?;
        }
        let mended = management::mend(self)?;
        (repair.secured, repair.renewed) = (mended.secured, mended.renewed);
        // Whoever makes something keeps half made things from being removed.
        drop(making);
        repair.cleaning = dead::clean(self, &self.config()?, dead::Scope::Everything);
        Ok(())
    }
}
