//! Taking part in the shared memory of a robot.

use std::ffi::{c_char, c_int};
use std::path::Path;

use ipc_types::{Domain, Ipc, SchedulingRole, request_slice};

use super::{OK, clear, closing, give, guard, optional_text, text, write};
use crate::error::Error;
use crate::joining::join;

/// `hero_ril_robot`
pub struct Robot {
    pub(super) ipc: Ipc,
}

/// Takes part in the shared memory of a robot (1, 2, …). `root` is its folder; null takes the usual one.
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

closing! { extern "C" fn hero_ril_leave(robot: *mut Robot); }

/// For a test: counts what is there of the shared memory `root`, after what no live process uses was removed if
/// `sweep`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_residue(
    root: *const c_char,
    sweep: c_int,
    count: *mut usize,
) -> c_int {
    guard(|| unsafe {
        let domain = Domain::new(Path::new(text(root, "root")?))?;
        if sweep != 0 {
            domain.remove_if_dead()?;
        }
        write(count, domain.residue().len(), "count")?;
        Ok(OK)
    })
}

/// Asks Linux (6.12 and later) for a slice of the thread's processor as `role` has it.
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_request_slice(role: c_int) -> c_int {
    guard(|| {
        request_slice(match role {
            0 => SchedulingRole::Provider,
            1 => SchedulingRole::Consumer,
            2 => SchedulingRole::Background,
            _ => return Err(Error::Invalid(format!("{role} is no hero_ril_role"))),
        });
        Ok(OK)
    })
}
