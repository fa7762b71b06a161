//! Taking part in the shared memory of a robot.

use std::ffi::{c_char, c_int};
use std::path::Path;

use ipc_types::{Domain, Ipc};

use super::{clear, close, give, guard, optional_text, text};
use crate::joining::join;

/// `hero_ril_robot`
pub struct Robot {
    pub(super) ipc: Ipc,
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_join(
    root: *const c_char,
    robot: u32,
    process_name: *const c_char,
    out: *mut *mut Robot,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let domain = match optional_text(root, "root")? {
            Some(root) => Domain::new(Path::new(root))?,
            None => Domain::from_environment()?,
        };
        let ipc = join(&domain, robot, text(process_name, "process_name")?)?;
        give(out, Robot { ipc })
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_leave(robot: *mut Robot) {
    unsafe { close(robot) }
}
