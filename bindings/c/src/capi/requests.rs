//! Sending requests, and following them to their final report.

use std::cell::RefCell;
use std::ffi::{CString, c_char, c_int, c_void};
use std::thread::LocalKey;

use ipc_types::code::ControlCommand;
use ipc_types::payload::{RequestReport, WaypointPosition};

use super::robot::Robot;
use super::{
    INTERRUPTED, NOTHING, OK, Service, clear, closing, give, guard, handle, null, service_name,
    timeout, write,
};
use crate::error::Error;
use crate::requests::{ReportWait, Requests, check_waypoints, reason_name, stage_name};

/// `hero_ril_waypoint`
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Waypoint {
    latitude_deg: f64,
    longitude_deg: f64,
    altitude_m: f64,
}

impl From<Waypoint> for WaypointPosition {
    fn from(waypoint: Waypoint) -> WaypointPosition {
        WaypointPosition {
            latitude_deg: waypoint.latitude_deg,
            longitude_deg: waypoint.longitude_deg,
            altitude_m: waypoint.altitude_m,
        }
    }
}

impl From<WaypointPosition> for Waypoint {
    fn from(place: WaypointPosition) -> Waypoint {
        Waypoint {
            latitude_deg: place.latitude_deg,
            longitude_deg: place.longitude_deg,
            altitude_m: place.altitude_m,
        }
    }
}

/// Opens a client of all request services of the robot, those of modules included.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_client_open(robot: *mut Robot, out: *mut *mut Requests) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let client = Requests::new(&handle(robot, "robot")?.ipc);
        give(out, client)
    })
}

closing! { extern "C" fn hero_ril_client_close(client: *mut Requests); }

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

/// Sends a request as its struct. A `request_id` of 0 in it is replaced; `request_id` gets the id.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_send(
    client: *mut Requests,
    service: *const Service,
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
            client.send(&service_name(service, "service")?, bytes)
        })
    }
}

/// Makes the client's next order the next step of the command whose last step is `request_id`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_follow(client: *mut Requests, request_id: u64) -> c_int {
    guard(|| unsafe {
        handle(client, "client")?.follow(request_id);
        Ok(OK)
    })
}

/// Sends the request to start the module; `request_id` gets its id.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_start(client: *mut Requests, request_id: *mut u64) -> c_int {
    unsafe {
        send(client, request_id, |client| {
            client.control(ControlCommand::Start)
        })
    }
}

/// Sends the request to stop the module; `request_id` gets its id.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_stop(client: *mut Requests, request_id: *mut u64) -> c_int {
    unsafe {
        send(client, request_id, |client| {
            client.control(ControlCommand::Stop)
        })
    }
}

/// Sends the request to take off to `altitude_m` above the ground of the take-off; `request_id` gets its id.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_take_off(
    client: *mut Requests,
    altitude_m: f64,
    request_id: *mut u64,
) -> c_int {
    unsafe { send(client, request_id, |client| client.take_off(altitude_m)) }
}

/// Sends the request to land on the spot; `preempt` other than 0 may replace a path. `request_id` gets its id.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_land(
    client: *mut Requests,
    preempt: c_int,
    request_id: *mut u64,
) -> c_int {
    unsafe { send(client, request_id, |client| client.land(preempt != 0)) }
}

/// Sends the request to hover on the spot; `request_id` gets its id.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_hold(client: *mut Requests, request_id: *mut u64) -> c_int {
    unsafe { send(client, request_id, Requests::hold) }
}

/// Says what becomes of later paths when this program ends, closes the client, or does not renew its lease.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_when_lost(
    client: *mut Requests,
    sender_lost: c_int,
    lease_ms: c_int,
) -> c_int {
    unsafe {
        send(client, std::ptr::null_mut(), |client| {
            // A number below 0 is none of the contract.
            let number = |value| u32::try_from(value).unwrap_or(u32::MAX);
            client
                .when_lost(number(sender_lost), number(lease_ms))
                .map(|()| 0)
        })
    }
}

/// Flies a path of 1 to 1024 waypoints. The id is that of the last waypoint, or of the first refused one.
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
            check_waypoints(count)?;
            // SAFETY: the caller has `count` waypoints there.
            let path: Vec<_> = std::slice::from_raw_parts(waypoints, count)
                .iter()
                .map(|waypoint| WaypointPosition::from(*waypoint))
                .collect();
            client.go_to(&path, preempt != 0)
        })
    }
}

/// Copies the oldest report about the request, of any request for 0; waits for it as long as `timeout_ms`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_next_report(
    client: *mut Requests,
    request_id: u64,
    timeout_ms: i32,
    report: *mut RequestReport,
) -> c_int {
    guard(|| unsafe {
        let client = handle(client, "client")?;
        // Before a report is taken, which could not be given back.
        if report.is_null() {
            return Err(null("report"));
        }
        match client.next_report(request_id, timeout(timeout_ms))? {
            ReportWait::Report(answer) => {
                write(report, answer, "report")?;
                Ok(OK)
            }
            ReportWait::Nothing => Ok(NOTHING),
            ReportWait::Interrupted => Ok(INTERRUPTED),
        }
    })
}

/// Writes a descriptor for each service that was sent to, at most `capacity`, and says how many there are.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_client_descriptors(
    client: *mut Requests,
    descriptors: *mut c_int,
    capacity: usize,
    count: *mut usize,
) -> c_int {
    guard(|| unsafe {
        let found = handle(client, "client")?.descriptors()?;
        if descriptors.is_null() && capacity > 0 {
            return Err(null("descriptors"));
        }
        for (index, descriptor) in found.iter().take(capacity).enumerate() {
            // SAFETY: the caller has `capacity` numbers there.
            descriptors.add(index).write(*descriptor);
        }
        write(count, found.len(), "count")?;
        Ok(if found.is_empty() { NOTHING } else { OK })
    })
}

/// Gives up all requests that have no final report yet: their servers see them as gone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_give_up(client: *mut Requests) -> c_int {
    guard(|| unsafe {
        handle(client, "client")?.give_up();
        Ok(OK)
    })
}

/// Whether no report follows this one about its request.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_is_final(report: *const RequestReport) -> c_int {
    // SAFETY: the caller has it point to a report, or nowhere.
    c_int::from(unsafe { report.as_ref() }.is_some_and(RequestReport::is_final))
}

/// The name of a stage, such as `done`; valid until the thread's next call of this function.
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_stage_name(stage: u32) -> *const c_char {
    thread_local!(static NAME: RefCell<CString> = RefCell::default());
    c_name(&NAME, stage_name(stage))
}

/// The name of a reason, such as `not-flying`; valid until the thread's next call of this function.
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
