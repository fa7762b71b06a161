//! Where a flight is played: shared memory of the replay's own, and never onto a robot that lives.

use std::path::Path;

use ipc_types::domain::ROOT_VARIABLE;
use ipc_types::{Domain, DynamicError, OpenError, RobotId};
use recording::play::ServicesError;
use runtime::exit::{ExitCode, Failure, OrFail};

/// The domain that `RIL_IPC_ROOT` names; else one for replays alone.
pub(super) fn domain() -> Result<Domain, Failure> {
    if std::env::var_os(ROOT_VARIABLE).is_some() {
        return Domain::from_environment().or_fail(ExitCode::Configuration);
    }
    let uid = rustix::process::geteuid().as_raw();
    Domain::new(Path::new(&format!("/dev/shm/hr{uid}"))).or_fail(ExitCode::Internal)
}

/// Refuses a robot of which any service has a live provider.
pub(super) fn refuse_living(domain: &Domain, robot: RobotId) -> Result<(), Failure> {
    let mut services = domain.topics(robot);
    services.extend(domain.request_services(robot));
    let living = services.into_iter().find_map(|service| {
        let provider = service.provider?;
        Some((service.key, provider.process, provider.pid))
    });
    match living {
        None => Ok(()),
        Some((key, process, pid)) => {
            let text = format!(
                "robot {robot} lives in {}: `{process}` (process {pid}) provides {key}; nothing is played onto it",
                domain.root().display()
            );
            Err(lives(text, robot))
        }
    }
}

/// The services cannot be provided.
pub(super) fn not_provided(error: ServicesError, robot: RobotId) -> Failure {
    match error {
        ServicesError::Topic(DynamicError::Open(error @ OpenError::AlreadyProvided { .. }))
        | ServicesError::Requests(error @ OpenError::AlreadyProvided { .. }) => {
            lives(error.to_string(), robot)
        }
        error => Failure::internal(error),
    }
}

fn lives(text: String, robot: RobotId) -> Failure {
    let other = robot.get().wrapping_add(1).max(1);
    Failure::new(ExitCode::Refused, text).with_next_step(format!(
        "play it as another robot with --robot {other}, or unset RIL_IPC_ROOT: then it has shared memory of its own"
    ))
}
