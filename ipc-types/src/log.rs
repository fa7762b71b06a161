//! What this crate says in its program's log: by the crate `tracing` where the program asks for that with the feature
//! of that name, else nothing. Errors are returned in any case.

#[cfg(feature = "tracing")]
pub(crate) use tracing::{debug, error, info, warn};

#[cfg(not(feature = "tracing"))]
macro_rules! nothing {
    ($($_:tt)*) => {{}};
}
#[cfg(not(feature = "tracing"))]
pub(crate) use {nothing as debug, nothing as error, nothing as info, nothing as warn};
