//! [`join`]: taking part in the shared memory of a robot, as a program or a module outside the RIL.

use ipc_types::module::is_own_name;
use ipc_types::{Domain, Ipc, RobotId};

use crate::error::Error;

/// Takes part in the shared memory of a robot as the process `name`.
///
/// # Errors
///
/// [`Error::Invalid`] when there is no such robot, or when the process has the name of one of the RIL's own modules,
/// whose keys belong to processes of these names; what the relay provides is taken for what comes from another machine.
/// See [`JoinError`](ipc_types::JoinError) for the others.
pub fn join(domain: &Domain, robot: u32, name: &str) -> Result<Ipc, Error> {
    let robot = RobotId::new(robot)
        .ok_or_else(|| Error::Invalid("a robot id is an integer greater than zero".into()))?;
    if is_own_name(name) {
        return Err(Error::Invalid(format!(
            "`{name}` is the name of the RIL's own module, which no other process can have: choose another name"
        )));
    }
    Ok(Ipc::join(domain, robot, name)?)
}
