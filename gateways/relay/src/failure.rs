//! [`Failure`]: why a relay cannot run.

use ipc_types::{JoinError, OpenError, WaitError};

use crate::network::NetworkError;
use crate::ros2::NameError;

/// Why a relay cannot run.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The shared memory of this machine cannot be used.
    #[error(transparent)]
    Join(#[from] JoinError),
    /// Another relay runs, or a service cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The network cannot be used.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The robot cannot be a node of ROS 2.
    #[error("the robot cannot be a node of ROS 2: {0}")]
    Ros2(#[from] NameError),
    /// The operating system cannot wait.
    #[error(transparent)]
    Wait(#[from] WaitError),
    /// The process has too many descriptors.
    #[error("the operating system gives no descriptor ({0})")]
    Descriptors(#[from] rustix::io::Errno),
}
