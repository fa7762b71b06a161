//! The C ABI. `include/hero_ril.h` is its contract; a test compares the two.
//!
//! Each function converts its arguments, calls safe code and returns a code. No panic leaves it: it becomes
//! [`Kind::Panic`], with its text as the thread's last error.

#![allow(unsafe_code)]
// The header says what callers must keep; Rust programs use ipc-types and not these functions.
#![allow(clippy::missing_safety_doc)]

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::os::fd::AsRawFd;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::thread::LocalKey;
use std::time::Duration;

use ipc_types::code::ControlCommand;
use ipc_types::payload::{RequestReport, WaypointPosition};
use ipc_types::{Domain, DynamicPublisher, Ipc, Losses, RobotId, Source, Waiter, Wake};

use crate::error::{Error, Kind};
use crate::requests::{Answer, Requests, reason_name, stage_name};
use crate::topic::{FOREVER, Inbox, Received, TopicName};

/// `HERO_RIL_OK`
const OK: c_int = 0;
/// `HERO_RIL_NOTHING`
const NOTHING: c_int = 1;
/// `HERO_RIL_INTERRUPTED`
const INTERRUPTED: c_int = 2;

/// `hero_ril_robot`
pub struct Robot {
    ipc: Ipc,
}

/// `hero_ril_topic`
#[repr(C)]
pub struct Topic {
    key: *const c_char,
    layout_hash: *const c_char,
    schema: *const c_char,
    size: usize,
}

/// `hero_ril_source`: one of the handles, the others are null.
#[repr(C)]
pub struct AnySource {
    subscriber: *mut Inbox,
    client: *mut Requests,
    publisher: *mut DynamicPublisher,
}

/// `hero_ril_waypoint`
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Waypoint {
    latitude_deg: f64,
    longitude_deg: f64,
    altitude_m: f64,
}

/// `hero_ril_losses`
#[repr(C)]
pub struct Counts {
    received: u64,
    lost: u64,
    repeated: u64,
    publisher_restarts: u64,
}

/// `hero_ril_sample_callback`
pub type SampleCallback = Option<unsafe extern "C" fn(*const c_void, usize, *mut c_void)>;

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

fn remember(text: &str) {
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    // Fails only while the thread ends: then nobody asks any more.
    let _ = LAST_ERROR.try_with(|last| *last.borrow_mut() = text);
}

/// Runs what a function does, and turns what comes of it into a code.
fn guard(act: impl FnOnce() -> Result<c_int, Error>) -> c_int {
    match catch_unwind(AssertUnwindSafe(act)) {
        Ok(Ok(code)) => code,
        Ok(Err(error)) => {
            remember(&error.text());
            error.kind() as c_int
        }
        Err(panic) => {
            let text = panic
                .downcast_ref::<String>()
                .map(String::as_str)
                .or(panic.downcast_ref::<&str>().copied())
                .unwrap_or("no reason");
            remember(&format!("a bug in the library: {text}; close the handle"));
            Kind::Panic as c_int
        }
    }
}

/// Drops a handle; a panic that comes of it is swallowed, because nobody could do anything about it.
unsafe fn close<T>(handle: *mut T) {
    if !handle.is_null() {
        guard(|| {
            // SAFETY: the caller got it from the function that made it, and uses it no more.
            drop(unsafe { Box::from_raw(handle) });
            Ok(OK)
        });
    }
}

fn null(what: &str) -> Error {
    Error::Invalid(format!("`{what}` is a null pointer"))
}

unsafe fn handle<'a, T>(pointer: *mut T, what: &str) -> Result<&'a mut T, Error> {
    // SAFETY: the caller got it from the function that made it, and no other thread uses it now.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(what))
}

unsafe fn give<T>(out: *mut *mut T, value: T) -> Result<c_int, Error> {
    // SAFETY: checked by `out_of` before the value was made.
    unsafe { out.write(Box::into_raw(Box::new(value))) };
    Ok(OK)
}

/// Checks where a new handle goes, and makes it null, so that closing it after a failure is harmless.
unsafe fn clear<T>(out: *mut *mut T) -> Result<(), Error> {
    match out.is_null() {
        true => Err(null("out")),
        // SAFETY: not null; the caller has it point to a variable.
        false => unsafe {
            out.write(std::ptr::null_mut());
            Ok(())
        },
    }
}

unsafe fn optional_text<'a>(text: *const c_char, what: &str) -> Result<Option<&'a str>, Error> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: not null; the caller ends it with a zero.
    let text = unsafe { CStr::from_ptr(text) };
    let text = text
        .to_str()
        .map_err(|_| Error::Invalid(format!("`{what}` is not UTF-8")))?;
    Ok(Some(text))
}

unsafe fn text<'a>(text: *const c_char, what: &str) -> Result<&'a str, Error> {
    // SAFETY: as the caller of this.
    unsafe { optional_text(text, what)? }.ok_or_else(|| null(what))
}

unsafe fn topic_name<'a>(topic: *const Topic) -> Result<TopicName<'a>, Error> {
    // SAFETY: the caller has it point to a topic, and its texts outlive the call.
    unsafe {
        let topic = topic.as_ref().ok_or_else(|| null("topic"))?;
        Ok(TopicName {
            key: text(topic.key, "key")?,
            layout_hash: optional_text(topic.layout_hash, "layout_hash")?,
            schema: optional_text(topic.schema, "schema")?,
            size: topic.size,
        })
    }
}

unsafe fn write<T>(out: *mut T, value: T, what: &str) -> Result<(), Error> {
    match out.is_null() {
        true => Err(null(what)),
        false => {
            // SAFETY: not null; the caller has it point to a variable.
            unsafe { out.write(value) };
            Ok(())
        }
    }
}

unsafe fn copy_out(sample: &[u8], to: *mut c_void, size: usize) -> Result<c_int, Error> {
    if to.is_null() {
        return Err(null("sample"));
    }
    if size != sample.len() {
        return Err(Error::Layout(format!(
            "a sample has {} bytes, the buffer has {size}",
            sample.len()
        )));
    }
    // SAFETY: not null, and the caller has `size` bytes there.
    unsafe { std::ptr::copy_nonoverlapping(sample.as_ptr(), to.cast(), size) };
    Ok(OK)
}

fn timeout(timeout_ms: i32) -> Duration {
    u64::try_from(timeout_ms).map_or(FOREVER, Duration::from_millis)
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_last_error() -> *const c_char {
    LAST_ERROR
        .try_with(|last| last.borrow().as_ptr())
        .unwrap_or(c"".as_ptr())
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_join(
    root: *const c_char,
    robot: u32,
    process_name: *const c_char,
    out: *mut *mut Robot,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let domain = match optional_text(root, "root")? {
            Some(root) => Domain::new(Path::new(root))?,
            None => Domain::from_environment()?,
        };
        let robot = RobotId::new(robot)
            .ok_or_else(|| Error::Invalid("a robot id is an integer greater than zero".into()))?;
        let ipc = Ipc::join(&domain, robot, text(process_name, "process_name")?)?;
        give(out, Robot { ipc })
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_leave(robot: *mut Robot) {
    unsafe { close(robot) }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_subscribe(
    robot: *mut Robot,
    topic: *const Topic,
    out: *mut *mut Inbox,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let inbox = Inbox::open(&handle(robot, "robot")?.ipc, &topic_name(topic)?)?;
        give(out, inbox)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_unsubscribe(subscriber: *mut Inbox) {
    unsafe { close(subscriber) }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_receive(
    subscriber: *mut Inbox,
    sample: *mut c_void,
    size: usize,
    timeout_ms: i32,
) -> c_int {
    guard(|| unsafe {
        match handle(subscriber, "subscriber")?.receive(timeout(timeout_ms))? {
            Received::Sample(received) => copy_out(received, sample, size),
            Received::Nothing => Ok(NOTHING),
            Received::Interrupted => Ok(INTERRUPTED),
        }
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_latest(
    subscriber: *mut Inbox,
    sample: *mut c_void,
    size: usize,
) -> c_int {
    guard(|| unsafe {
        match handle(subscriber, "subscriber")?.latest()? {
            Some(latest) => copy_out(latest, sample, size),
            None => Ok(NOTHING),
        }
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_drain(
    subscriber: *mut Inbox,
    callback: SampleCallback,
    context: *mut c_void,
) -> c_int {
    guard(|| unsafe {
        let callback = callback.ok_or_else(|| null("callback"))?;
        let inbox = handle(subscriber, "subscriber")?;
        let taken =
            inbox.drain_into(|sample| callback(sample.as_ptr().cast(), sample.len(), context))?;
        Ok(if taken > 0 { OK } else { NOTHING })
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_sample_size(subscriber: *const Inbox) -> usize {
    // SAFETY: the caller got it from `hero_ril_subscribe`.
    unsafe { subscriber.as_ref() }.map_or(0, |inbox| inbox.subscriber().schema().size())
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_count(subscriber: *mut Inbox, losses: *mut Counts) -> c_int {
    guard(|| unsafe {
        let Losses {
            received,
            lost,
            repeated,
            publisher_restarts,
        } = handle(subscriber, "subscriber")?.subscriber().losses();
        let counts = Counts {
            received,
            lost,
            repeated,
            publisher_restarts,
        };
        write(losses, counts, "losses")?;
        Ok(OK)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_descriptor(
    subscriber: *mut Inbox,
    descriptor: *mut c_int,
    generation: *mut u64,
) -> c_int {
    guard(|| unsafe {
        let subscriber = handle(subscriber, "subscriber")?.subscriber();
        let number = subscriber.descriptor()?.as_raw_fd();
        write(descriptor, number, "descriptor")?;
        if !generation.is_null() {
            generation.write(subscriber.generations());
        }
        Ok(OK)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_advertise(
    robot: *mut Robot,
    topic: *const Topic,
    out: *mut *mut DynamicPublisher,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let publisher = topic_name(topic)?.publisher(&handle(robot, "robot")?.ipc)?;
        give(out, publisher)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_publish(
    publisher: *mut DynamicPublisher,
    sample: *const c_void,
    size: usize,
    sequence: *mut u64,
) -> c_int {
    guard(|| unsafe {
        let publisher = handle(publisher, "publisher")?;
        if sample.is_null() {
            return Err(null("sample"));
        }
        if size != publisher.schema().size() {
            return Err(Error::Layout(format!(
                "a sample has {} bytes, {size} were given",
                publisher.schema().size()
            )));
        }
        publisher.tend();
        let number = publisher.publish(|bytes| {
            // SAFETY: the caller has `size` bytes there, which are as many as `bytes` has.
            bytes.copy_from_slice(std::slice::from_raw_parts(sample.cast(), size));
        })?;
        if !sequence.is_null() {
            sequence.write(number);
        }
        Ok(OK)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_tend(publisher: *mut DynamicPublisher) -> c_int {
    guard(|| unsafe {
        handle(publisher, "publisher")?.tend();
        Ok(OK)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_withdraw(publisher: *mut DynamicPublisher) {
    unsafe { close(publisher) }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_client_open(robot: *mut Robot, out: *mut *mut Requests) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let client = Requests::new(&handle(robot, "robot")?.ipc);
        give(out, client)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_client_close(client: *mut Requests) {
    unsafe { close(client) }
}

/// Sends a request and writes its id.
unsafe fn send(
    client: *mut Requests,
    request_id: *mut u64,
    send: impl FnOnce(&mut Requests) -> Result<u64, Error>,
) -> c_int {
    guard(|| unsafe {
        let id = send(handle(client, "client")?)?;
        if !request_id.is_null() {
            request_id.write(id);
        }
        Ok(OK)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_send(
    client: *mut Requests,
    key: *const c_char,
    request: *const c_void,
    size: usize,
    request_id: *mut u64,
) -> c_int {
    unsafe {
        send(client, request_id, |client| {
            if request.is_null() {
                return Err(null("request"));
            }
            // SAFETY: the caller has `size` bytes there.
            let bytes = std::slice::from_raw_parts(request.cast(), size);
            client.send_bytes(text(key, "key")?, bytes)
        })
    }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_start(client: *mut Requests, request_id: *mut u64) -> c_int {
    unsafe {
        send(client, request_id, |client| {
            client.control(ControlCommand::Start)
        })
    }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_stop(client: *mut Requests, request_id: *mut u64) -> c_int {
    unsafe {
        send(client, request_id, |client| {
            client.control(ControlCommand::Stop)
        })
    }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_take_off(
    client: *mut Requests,
    altitude_m: f64,
    request_id: *mut u64,
) -> c_int {
    unsafe { send(client, request_id, |client| client.take_off(altitude_m)) }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_land(
    client: *mut Requests,
    preempt: c_int,
    request_id: *mut u64,
) -> c_int {
    unsafe { send(client, request_id, |client| client.land(preempt != 0)) }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_hold(client: *mut Requests, request_id: *mut u64) -> c_int {
    unsafe { send(client, request_id, Requests::hold) }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_go_to(
    client: *mut Requests,
    waypoints: *const Waypoint,
    count: usize,
    preempt: c_int,
    request_id: *mut u64,
) -> c_int {
    unsafe {
        send(client, request_id, |client| {
            if waypoints.is_null() {
                return Err(null("waypoints"));
            }
            // SAFETY: the caller has `count` waypoints there.
            let path: Vec<_> = std::slice::from_raw_parts(waypoints, count)
                .iter()
                .map(|waypoint| WaypointPosition {
                    latitude_deg: waypoint.latitude_deg,
                    longitude_deg: waypoint.longitude_deg,
                    altitude_m: waypoint.altitude_m,
                })
                .collect();
            client.go_to(&path, preempt != 0)
        })
    }
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_next_report(
    client: *mut Requests,
    request_id: u64,
    timeout_ms: i32,
    report: *mut RequestReport,
) -> c_int {
    guard(|| unsafe {
        match handle(client, "client")?.next_report(request_id, timeout(timeout_ms))? {
            Answer::Report(answer) => {
                write(report, answer, "report")?;
                Ok(OK)
            }
            Answer::Nothing => Ok(NOTHING),
            Answer::Interrupted => Ok(INTERRUPTED),
        }
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_is_final(report: *const RequestReport) -> c_int {
    // SAFETY: the caller has it point to a report, or nowhere.
    c_int::from(unsafe { report.as_ref() }.is_some_and(RequestReport::is_final))
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_stage_name(stage: u32) -> *const c_char {
    thread_local!(static NAME: RefCell<CString> = RefCell::default());
    c_name(&NAME, stage_name(stage))
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_reason_name(reason: u32) -> *const c_char {
    thread_local!(static NAME: RefCell<CString> = RefCell::default());
    c_name(&NAME, reason_name(reason))
}

/// The name with a zero at its end, kept where the thread keeps it.
fn c_name(place: &'static LocalKey<RefCell<CString>>, name: &str) -> *const c_char {
    let name = CString::new(name).unwrap_or_default();
    place
        .try_with(|last| {
            *last.borrow_mut() = name;
            last.borrow().as_ptr()
        })
        .unwrap_or(c"".as_ptr())
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
                if let Some(inbox) = source.subscriber.as_mut() {
                    if inbox.has_buffered() {
                        return Ok(OK);
                    }
                    all.push(((), inbox.subscriber_mut()));
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

/// Panics within the guard: for the test that no panic leaves the library.
#[doc(hidden)]
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_test_panic() -> c_int {
    guard(|| panic!("on purpose"))
}
