//! Waiting for several handles at once.

use std::ffi::{c_int, c_void};

use ipc_types::waiter::MAX_SOURCES;
use ipc_types::{DynamicPublisher, DynamicSubscriber, Source, WaitError, Waiter, Wake};

use super::{INTERRUPTED, NOTHING, OK, guard, null, timeout};
use crate::error::Error;
use crate::requests::Requests;
use crate::serving::Serving;

/// `hero_ril_source`: one of the handles, the others are null.
#[repr(C)]
pub struct AnySource {
    subscriber: *mut DynamicSubscriber,
    client: *mut Requests,
    publisher: *mut DynamicPublisher,
    server: *mut Serving,
}

/// Each handle is borrowed mutably for the wait, so it can stand there once.
fn check_distinct(sources: &[AnySource]) -> Result<(), Error> {
    let handles = |source: &AnySource| -> [*const c_void; 4] {
        [
            source.subscriber.cast(),
            source.client.cast(),
            source.publisher.cast(),
            source.server.cast(),
        ]
    };
    let mut all: Vec<_> = sources.iter().flat_map(handles).collect();
    all.retain(|handle| !handle.is_null());
    all.sort_unstable();
    match all.windows(2).any(|pair| pair[0] == pair[1]) {
        true => Err(Error::Invalid("`sources` has a handle twice".to_owned())),
        false => Ok(()),
    }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_wait(
    sources: *const AnySource,
    count: usize,
    timeout_ms: i32,
) -> c_int {
    guard(|| unsafe {
        if sources.is_null() {
            return Err(null("sources"));
        }
        match count {
            0 => return Err(WaitError::NoSources.into()),
            1..=MAX_SOURCES => {}
            _ => return Err(WaitError::TooManySources(count).into()),
        }
        // SAFETY: the caller has `count` sources there, whose handles no other thread uses now.
        let sources = std::slice::from_raw_parts(sources, count);
        check_distinct(sources)?;
        let wake = {
            let mut all: Vec<((), &mut dyn Source)> = Vec::with_capacity(count);
            for source in sources {
                if let Some(subscriber) = source.subscriber.as_mut() {
                    all.push(((), subscriber));
                }
                if let Some(client) = source.client.as_mut() {
                    if client.has_waiting() {
                        return Ok(OK);
                    }
                    all.extend(client.sources().into_iter().map(|source| ((), source)));
                }
                if let Some(publisher) = source.publisher.as_mut() {
                    all.push(((), publisher));
                }
                if let Some(server) = source.server.as_mut() {
                    if server.has_waiting() {
                        return Ok(OK);
                    }
                    all.push(((), server.source()));
                }
            }
            Waiter::new().wait(&mut all, Some(timeout(timeout_ms)))?
        };
        Ok(match wake {
            Wake::Ready(_) => OK,
            Wake::TimedOut => NOTHING,
            Wake::Interrupted => INTERRUPTED,
        })
    })
}
