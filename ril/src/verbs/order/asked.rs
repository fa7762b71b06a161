//! [`run`]: one command that makes its requests and only follows them.

use ipc_types::Request;
use runtime::exit::Failure;

use crate::options::RequestArgs;
use crate::render::messages::Verb;
use crate::request::{Conversation, Format, Until};
use crate::session::OrderContext;

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
    let asked = OrderContext::of(&args.ask)?;
    let requests = requests(&asked)?;
    Conversation::open_at(&asked.session, key, verb, asked.timeout)?
        .follow(&requests, until(args), Format::of(args.ask.json))
        .map(drop)
}
