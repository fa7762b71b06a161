//! A module in C: the rules of start and stop, the state and the control.

use std::ffi::{c_char, c_int};

use ipc_types::MonotonicNs;
use module_kit::OnStop;
use runtime::signal::Termination;

use super::robot::Robot;
use super::waiting::{AnySource, with_sources};
use super::{
    INTERRUPTED, NOTHING, OK, Service, clear, closing, give, guard, handle, service_name, text,
    timeout,
};
use crate::error::Error;
use crate::module::{Event, OwnModule};
use crate::serving::Serving;

/// `HERO_RIL_STARTED`
const STARTED: c_int = 4;
/// `HERO_RIL_STOPPED`
const STOPPED: c_int = 5;
/// `HERO_RIL_ENDING`
const ENDING: c_int = 6;

/// Becomes the module `name` with an `id` from 1000 to 9999: publishes its state and serves its control.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_module_open(
    robot: *mut Robot,
    name: *const c_char,
    id: u32,
    takes_signals: c_int,
    out: *mut *mut OwnModule,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let ipc = &handle(robot, "robot")?.ipc;
        let termination = match takes_signals {
            0 => None,
            _ => Some(Termination::install()?),
        };
        let module = OwnModule::open(ipc, text(name, "name")?, id, termination)?;
        give(out, module)
    })
}

closing! { extern "C" fn hero_ril_module_close(module: *mut OwnModule); }

/// Waits as `hero_ril_wait` does, for at most 13 sources; also serves the control and publishes the state.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_module_wait(
    module: *mut OwnModule,
    sources: *const AnySource,
    count: usize,
    timeout_ms: i32,
) -> c_int {
    guard(|| unsafe {
        let module = handle(module, "module")?;
        let event = with_sources(sources, count, |all, has_waiting| match has_waiting {
            false => module.wait(all, timeout(timeout_ms)),
            // What the program has not taken yet; an event of the module comes first.
            true => Ok(match module.wait(all, timeout(0))? {
                Event::TimedOut => Event::Ready,
                event => event,
            }),
        })?;
        Ok(match event {
            Event::Ready => OK,
            Event::TimedOut => NOTHING,
            Event::Interrupted => INTERRUPTED,
            Event::Started => STARTED,
            Event::Stopped => STOPPED,
            Event::Ending => ENDING,
        })
    })
}

/// Serves a request service of the module: each request is taken once, and none whose `begin_by_ns` has passed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_module_serve(
    robot: *mut Robot,
    service: *const Service,
    out: *mut *mut Serving,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let ipc = &handle(robot, "robot")?.ipc;
        give(
            out,
            Serving::open_once(ipc, &service_name(service, "service")?)?,
        )
    })
}

/// Begins work: `functionality` is the module's own number of it, `doing` its name, `on_stop` what a stop does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_module_begin(
    module: *mut OwnModule,
    functionality: u32,
    doing: *const c_char,
    on_stop: c_int,
) -> c_int {
    guard(|| unsafe {
        let on_stop = match on_stop {
            0 => OnStop::Aborts,
            1 => OnStop::Ends,
            2 => OnStop::Refused,
            _ => return Err(Error::Invalid(format!("{on_stop} is no hero_ril_on_stop"))),
        };
        let (manager, now) = (handle(module, "module")?.manager(), MonotonicNs::now());
        let has_begun = manager.begin(now, functionality, text(doing, "doing")?, on_stop);
        Ok(if has_begun { OK } else { NOTHING })
    })
}

/// Says that the work ended as it should.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_module_done(module: *mut OwnModule) -> c_int {
    guard(|| unsafe {
        let manager = handle(module, "module")?.manager();
        manager.done(MonotonicNs::now());
        Ok(OK)
    })
}

/// Says that the work ended early: the module is blocked until the next start. `error` is from 1000 to 9999.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_module_fail(module: *mut OwnModule, error: u32) -> c_int {
    guard(|| unsafe {
        let manager = handle(module, "module")?.manager();
        manager.fail(MonotonicNs::now(), error);
        Ok(OK)
    })
}

/// Whether the module may command anything: it was started, and neither a stop nor an error has ended that.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_module_is_started(module: *mut OwnModule) -> c_int {
    // SAFETY: the caller got it from `hero_ril_module_open`, or has none.
    c_int::from(unsafe { module.as_mut() }.is_some_and(|module| module.manager().is_started()))
}
