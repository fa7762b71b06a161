//! The C ABI. `include/hero_ril.h` is its contract; a test compares the two.
//!
//! Each function converts its arguments, calls safe code and returns a code. No panic leaves it: it becomes
//! [`ErrorKind::Panic`], with its text as the thread's last error. Here are the conversions; the functions are in
//!
//! * [`robot`]: taking part;
//! * [`topics`]: subscribing and publishing;
//! * [`requests`]: sending requests and following them;
//! * [`serving`]: serving requests;
//! * [`module`]: being a module;
//! * [`waiting`]: several at once;
//! * [`places`]: degrees, metres north and east, UTC.

#![allow(unsafe_code)]
// The header says what callers must keep; Rust programs use ipc-types and not these functions.
#![allow(clippy::missing_safety_doc)]

pub mod module;
pub mod places;
pub mod requests;
pub mod robot;
pub mod serving;
pub mod topics;
pub mod waiting;

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use runtime::output;

use crate::error::{Error, ErrorKind};
use crate::service::ServiceName;
use crate::topic::FOREVER;

/// `HERO_RIL_OK`
const OK: c_int = 0;
/// `HERO_RIL_NOTHING`
const NOTHING: c_int = 1;
/// `HERO_RIL_INTERRUPTED`
const INTERRUPTED: c_int = 2;
/// `HERO_RIL_GONE`
const GONE: c_int = 3;

/// `hero_ril_topic`
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Topic {
    /// The key, such as `hero_telemetry`.
    pub key: *const c_char,
    /// The hash of the layout that the program has; null is not checked.
    pub layout_hash: *const c_char,
    /// The layout in ROS 2's message format; null takes the known one, or the one that the publisher has laid down.
    pub schema: *const c_char,
    /// Size of the struct, bytes.
    pub size: usize,
}

/// `hero_ril_service`
pub type Service = Topic;

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

fn remember(text: &str) {
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    // Fails only while the thread ends: then the program cannot ask any more.
    let _ = LAST_ERROR.try_with(|last| *last.borrow_mut() = text);
}

/// Runs what a function does, and turns what comes of it into a code.
fn guard(act: impl FnOnce() -> Result<c_int, Error>) -> c_int {
    output::bound_panics();
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
            ErrorKind::Panic as c_int
        }
    }
}

/// Drops a handle; a panic that comes of it is swallowed, because the caller could do nothing about it.
unsafe fn close<T>(handle: *mut T) {
    if !handle.is_null() {
        guard(|| {
            // SAFETY: the caller got it from the function that made it, and uses it no more.
            drop(unsafe { Box::from_raw(handle) });
            Ok(OK)
        });
    }
}

/// Defines a function that drops a handle: nothing happens to a null pointer.
macro_rules! closing {
    (extern "C" fn $name:ident($handle:ident: *mut $kind:ty);) => {
        /// Drops the handle: nothing happens to a null pointer.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($handle: *mut $kind) {
            unsafe { super::close($handle) }
        }
    };
}
use closing;

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

unsafe fn service_name<'a>(service: *const Topic, what: &str) -> Result<ServiceName<'a>, Error> {
    // SAFETY: the caller has it point to a service, and its texts outlive the call.
    unsafe {
        let service = service.as_ref().ok_or_else(|| null(what))?;
        Ok(ServiceName {
            key: text(service.key, "key")?,
            layout_hash: optional_text(service.layout_hash, "layout_hash")?,
            schema: optional_text(service.schema, "schema")?,
            size: service.size,
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

fn timeout(timeout_ms: i32) -> Duration {
    u64::try_from(timeout_ms).map_or(FOREVER, Duration::from_millis)
}

/// The text of the thread's last error; valid until its next error.
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_last_error() -> *const c_char {
    LAST_ERROR
        .try_with(|last| last.borrow().as_ptr())
        .unwrap_or(c"".as_ptr())
}

/// Panics within the guard: for the test that no panic leaves the library.
#[doc(hidden)]
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_test_panic() -> c_int {
    guard(|| panic!("on purpose"))
}
