//! [`Latest`]: the newest sample of a topic.

use ipc_types::{Ipc, Subscriber, Topic};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::Session;

/// The newest sample of a topic, and the port it comes from.
pub(crate) struct Latest<T: Topic> {
    /// What to wait for.
    pub port: Subscriber<T>,
    /// `None` before the first one.
    pub sample: Option<T>,
}

impl<T: Topic> Latest<T> {
    /// Subscribes to the topic.
    pub fn open(ipc: &Ipc) -> Result<Latest<T>, Failure> {
        Ok(Latest {
            port: ipc.subscriber().or_fail(ExitCode::Internal)?,
            sample: None,
        })
    }

    /// The same, or `None` if no process provides the topic.
    pub fn open_if_provided(session: &Session) -> Result<Option<Latest<T>>, Failure> {
        match session.is_provided(T::KEY)? {
            true => Latest::open(&session.ipc).map(Some),
            false => Ok(None),
        }
    }

    /// Takes what came, and says whether something did.
    pub fn drain(&mut self) -> bool {
        match self.port.latest() {
            Ok(Some(sample)) => {
                self.sample = Some(sample);
                true
            }
            Ok(None) => false,
            Err(error) => {
                tracing::warn!(%error, "samples could not be received");
                false
            }
        }
    }
}
