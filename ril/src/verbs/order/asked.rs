//! [`OrderContext`]: what a command has when it makes its requests; [`run`]: one command that only follows them.

use std::time::Duration;

use ipc_types::Request;
use runtime::exit::Failure;

use crate::config::Config;
use crate::options::{AskArgs, RequestArgs};
use crate::render::messages::Verb;
use crate::request::{Conversation, Format, Until};
use crate::session::{Session, configuration, refuse_to_guess};

/// What a command has when it makes its requests.
pub(super) struct OrderContext {
    pub session: Session,
    pub config: Config,
    pub timeout: Duration,
    pub deadline_ms: u32,
}

impl OrderContext {
    /// `None` when only the configuration was to be checked.
    pub fn of(ask: &AskArgs) -> Result<Option<OrderContext>, Failure> {
        let Some(config) = configuration(&ask.common)? else {
            return Ok(None);
        };
        refuse_to_guess(&ask.common)?;
        let session = Session::join(&ask.common)?;
        Ok(Some(OrderContext {
            session,
            timeout: ask.timeout.unwrap_or_else(|| config.request.timeout()),
            deadline_ms: ask.deadline.unwrap_or(config.request.deadline_ms),
            config,
        }))
    }
}

/// Until when the request is followed.
pub(super) fn until(args: &RequestArgs) -> Until {
    match args.no_wait {
        true => Until::Accepted,
        false => Until::Final,
    }
}

/// Runs one command over the service `key`, with what `requests` makes.
pub(super) fn run<R: Request>(
    verb: Verb,
    key: &'static str,
    args: &RequestArgs,
    requests: impl FnOnce(&OrderContext) -> Result<Vec<R>, Failure>,
) -> Result<(), Failure> {
    let Some(asked) = OrderContext::of(&args.ask)? else {
        return Ok(());
    };
    let requests = requests(&asked)?;
    Conversation::open_at(&asked.session, key, verb, asked.timeout)?
        .follow(&requests, until(args), Format::of(args.ask.json))
        .map(drop)
}
