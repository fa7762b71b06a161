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

/// Hands `act` the sources, and whether something lies in one of them that was received before.
///
/// # Safety
///
/// The caller has `count` sources there, whose handles no other thread uses now.
pub(super) unsafe fn with_sources<T>(
    sources: *const AnySource,
    count: usize,
    act: impl FnOnce(&mut [&mut dyn Source], bool) -> Result<T, Error>,
) -> Result<T, Error> {
    let sources = match (sources.is_null(), count) {
        (_, 0) => &[],
        (true, _) => return Err(null("sources")),
        // SAFETY: see above.
        (false, 1..=MAX_SOURCES) => unsafe { std::slice::from_raw_parts(sources, count) },
        _ => return Err(WaitError::TooManySources(count).into()),
    };
    check_distinct(sources)?;
    let mut all: Vec<&mut dyn Source> = Vec::with_capacity(count);
    let mut has_waiting = false;
    for source in sources {
        // SAFETY: see above; each handle stands there once.
        let (subscriber, client, publisher, server) = unsafe {
            (
                source.subscriber.as_mut(),
                source.client.as_mut(),
                source.publisher.as_mut(),
                source.server.as_mut(),
            )
        };
        if let Some(subscriber) = subscriber {
            all.push(subscriber);
        }
        if let Some(client) = client {
            has_waiting |= client.has_waiting();
            all.extend(client.sources().into_iter().map(|source| source as _));
        }
        if let Some(publisher) = publisher {
            all.push(publisher);
        }
        if let Some(server) = server {
            has_waiting |= server.has_waiting();
            all.push(server.source());
        }
    }
    act(&mut all, has_waiting)
}

/// Sleeps until one of the sources may have something, or the time is over.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_wait(
    sources: *const AnySource,
    count: usize,
    timeout_ms: i32,
) -> c_int {
    guard(|| unsafe {
        match (sources.is_null(), count) {
            (true, _) => return Err(null("sources")),
            (false, 0) => return Err(WaitError::NoSources.into()),
            _ => {}
        }
        with_sources(sources, count, |all, has_waiting| {
            if has_waiting {
                return Ok(OK);
            }
            let mut keyed: Vec<((), &mut dyn Source)> = Vec::with_capacity(all.len());
            for source in all {
                keyed.push(((), &mut **source));
            }
            let wake = Waiter::new().wait(&mut keyed, Some(timeout(timeout_ms)))?;
            Ok(match wake {
                Wake::Ready(_) => OK,
                Wake::TimedOut => NOTHING,
                Wake::Interrupted => INTERRUPTED,
            })
        })
    })
}
