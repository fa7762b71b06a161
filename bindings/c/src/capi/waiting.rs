//! Waiting for several handles at once.

use std::ffi::c_int;

use ipc_types::{DynamicPublisher, DynamicSubscriber, Source, Waiter, Wake};

use super::{INTERRUPTED, NOTHING, OK, guard, null, timeout};
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
        // SAFETY: the caller has `count` sources there, whose handles no other thread uses now.
        let sources = std::slice::from_raw_parts(sources, count);
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
