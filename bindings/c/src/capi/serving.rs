//! Serving requests.

use std::ffi::{c_int, c_void};
use std::os::fd::AsRawFd;

use ipc_types::Ticket;
use ipc_types::payload::RequestReport;

use super::robot::Robot;
use super::{
    GONE, INTERRUPTED, NOTHING, OK, Service, clear, closing, give, guard, handle, null,
    service_name, timeout, write,
};
use crate::error::Error;
use crate::serving::{Reported, Serving, ServingEvent};

/// Becomes the one server of a request service; a module's own request needs its schema.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_serve(
    robot: *mut Robot,
    service: *const Service,
    out: *mut *mut Serving,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let ipc = &handle(robot, "robot")?.ipc;
        give(out, Serving::open(ipc, &service_name(service, "service")?)?)
    })
}

closing! { extern "C" fn hero_ril_server_close(server: *mut Serving); }

/// Takes what is to be done next; waits for it as long as `timeout_ms`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_take(
    server: *mut Serving,
    request: *mut c_void,
    size: usize,
    ticket: *mut u64,
    timeout_ms: i32,
) -> c_int {
    guard(|| unsafe {
        let server = handle(server, "server")?;
        // Before a request is taken, which could not be given back.
        if request.is_null() || ticket.is_null() {
            return Err(null(if ticket.is_null() {
                "ticket"
            } else {
                "request"
            }));
        }
        if size != server.request_size() {
            return Err(Error::Layout(format!(
                "a request has {} bytes, the buffer has {size}",
                server.request_size()
            )));
        }
        match server.take(timeout(timeout_ms))? {
            ServingEvent::Request(of, bytes) => {
                write(ticket, of.to_bits(), "ticket")?;
                // SAFETY: not null, and the caller has `size` bytes there, as many as a request has.
                std::ptr::copy_nonoverlapping(bytes.as_ptr(), request.cast(), size);
                Ok(OK)
            }
            ServingEvent::Gone(of) => {
                write(ticket, of.to_bits(), "ticket")?;
                Ok(GONE)
            }
            ServingEvent::Nothing => Ok(NOTHING),
            ServingEvent::Interrupted => Ok(INTERRUPTED),
        }
    })
}

/// Answers a request: accepted at once, any number of progress, one final report.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_report(
    server: *mut Serving,
    ticket: u64,
    report: *const RequestReport,
) -> c_int {
    guard(|| unsafe {
        let server = handle(server, "server")?;
        // SAFETY: the caller has it point to a report, or nowhere.
        let report = report.as_ref().ok_or_else(|| null("report"))?;
        Ok(match server.report(Ticket::from_bits(ticket), report)? {
            Reported::Sent => OK,
            Reported::Dropped => NOTHING,
            Reported::Gone => GONE,
        })
    })
}

/// A descriptor for an event loop: readable when there may be something to take.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_server_descriptor(
    server: *mut Serving,
    descriptor: *mut c_int,
) -> c_int {
    guard(|| unsafe {
        let server = handle(server, "server")?.server();
        write(descriptor, server.descriptor()?.as_raw_fd(), "descriptor")?;
        Ok(OK)
    })
}
