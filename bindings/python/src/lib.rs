//! `hero_ril._native`: what the Python package needs of the library. Bytes and numbers only; structs are made in
//! Python.
//!
//! Every call that may take long releases Python's lock: waits, which let Python run its signal handlers, opening,
//! sending and closing. A handle that one thread waits with is busy for the others: pyo3 then raises `RuntimeError`.
//! Servers can be used by several threads at a time, so that one takes requests and others answer them. A panic becomes
//! `PanicException`.

use std::ffi::OsString;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use hero_ril::error::{Error, ErrorKind};
use hero_ril::joining::join;
use hero_ril::module::{Event, OwnModule};
use hero_ril::requests::{ReportWait, Requests, reason_name, stage_name};
use hero_ril::service::ServiceName;
use hero_ril::serving::{Reported, Serving, ServingEvent};
use hero_ril::topic::{self, FOREVER, SampleWait};
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::dynamic::topics;
use ipc_types::payload::{RequestReport, SharedStruct, WaypointPosition};
use ipc_types::schema::{Kind as FieldKind, Message};
use ipc_types::{
    Descriptor, Domain, DynamicPublisher, DynamicSubscriber, Forked, Ipc, MonotonicNs,
    Patience, SchedulingRole, Schema, Source, Ticket, Waiter,
};
use module_kit::runtime::config::Fault;
use module_kit::runtime::exit::{self, ExitCode, Failure};
use module_kit::runtime::output;
use module_kit::runtime::signal::Termination;
use module_kit::{OnStop, SetUp};
use pyo3::exceptions::{PySystemExit as SystemExit, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList};

mod exceptions {
    use pyo3::create_exception;
    use pyo3::exceptions::PyException;

    create_exception!(hero_ril, RilError, PyException);
    create_exception!(hero_ril, LayoutError, RilError);
    create_exception!(hero_ril, NotThereError, RilError);
    create_exception!(hero_ril, TakenError, RilError);
    create_exception!(hero_ril, FullError, RilError);
}

use exceptions::{FullError, LayoutError, NotThereError, RilError, TakenError};

/// Longest uninterrupted wait: a signal that another thread got is noticed after it.
const SLICE: Duration = ipc_types::waiter::SAFETY_BOUND;

fn raise(error: Error) -> PyErr {
    let text = error.text();
    match error.kind() {
        ErrorKind::Invalid => PyValueError::new_err(text),
        ErrorKind::Layout => LayoutError::new_err(text),
        ErrorKind::NotThere => NotThereError::new_err(text),
        ErrorKind::Taken => TakenError::new_err(text),
        ErrorKind::Full => FullError::new_err(text),
        ErrorKind::Failed | ErrorKind::Panic => RilError::new_err(text),
    }
}

fn closed() -> PyErr {
    PyValueError::new_err("it is closed")
}

fn duration(timeout_s: Option<f64>) -> PyResult<Duration> {
    match timeout_s {
        None => Ok(FOREVER),
        Some(seconds) => Duration::try_from_secs_f64(seconds.max(0.0))
            .map(|timeout| timeout.min(FOREVER))
            .map_err(|error| PyValueError::new_err(error.to_string())),
    }
}

// With the ABI that a thread's end may unwind through, which pyo3 declares otherwise.
#[allow(unsafe_code)]
unsafe extern "C-unwind" {
    fn PyEval_SaveThread() -> *mut pyo3::ffi::PyThreadState;
    fn PyEval_RestoreThread(state: *mut pyo3::ffi::PyThreadState);
}

/// Lets a thread sleep for ever that Python wants to end.
struct Sleeps;

impl Drop for Sleeps {
    fn drop(&mut self) {
        loop {
            std::thread::park();
        }
    }
}

/// Calls `act` without Python's lock, and takes the lock again. `act` has nothing of Python.
///
/// Before 3.14, an interpreter that ends does not give the lock to daemon threads but ends them where they are, by
/// unwinding their stacks. Rust's frames below cannot be unwound so: the process would abort. Such a thread sleeps
/// instead, as it does from 3.14 on, and ends with the process.
fn unlocked<T: Send>(_: Python<'_>, act: impl FnOnce() -> T + Send) -> T {
    // SAFETY: the lock is held, as `Python` proves, and `act` uses nothing of Python. It is taken again in any case: a
    // panic is caught until then.
    #[allow(unsafe_code)]
    unsafe {
        let state = PyEval_SaveThread();
        let done = catch_unwind(AssertUnwindSafe(act));
        let sleeps = Sleeps;
        PyEval_RestoreThread(state);
        std::mem::forget(sleeps);
        done.unwrap_or_else(|panic| resume_unwind(panic))
    }
}

/// Waits in slices, between which Python's signal handlers run. `attempt` returns nothing when its slice is over.
fn wait<T>(
    py: Python<'_>,
    timeout_s: Option<f64>,
    mut attempt: impl FnMut(Duration) -> Result<Option<T>, Error> + Send,
) -> PyResult<Option<T>>
where
    T: Send,
{
    // Python's lock is not worth releasing for what is there already.
    if let Some(found) = attempt(Duration::ZERO).map_err(raise)? {
        return Ok(Some(found));
    }
    let deadline = Instant::now() + duration(timeout_s)?;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(None);
        }
        let slice = left.min(SLICE);
        if let Some(found) = unlocked(py, || attempt(slice)).map_err(raise)? {
            return Ok(Some(found));
        }
        py.check_signals()?;
    }
}

/// Forks between the start of the interpreter and this process. The package has Python count them.
static FORKS: AtomicU32 = AtomicU32::new(0);

/// Called in a child that was forked.
#[pyfunction]
fn count_fork() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

/// The process that made a handle.
struct Maker(u32);

impl Maker {
    fn this_process() -> Maker {
        Maker(FORKS.load(Ordering::Relaxed))
    }

    /// Whether this is the process that made it. In a child that was forked a lock may be held by a thread that is not
    /// there.
    fn check(&self) -> PyResult<()> {
        match self.0 == FORKS.load(Ordering::Relaxed) {
            true => Ok(()),
            false => Err(raise(Forked.into())),
        }
    }
}

/// A handle that Python may name from every thread. It is used only through `&mut`, so nothing is ever locked; the
/// mutex stands for that towards the compiler.
struct Handle<T> {
    slot: Mutex<Option<T>>,
    maker: Maker,
}

impl<T> Handle<T> {
    fn new(handle: T) -> Handle<T> {
        Handle {
            slot: Mutex::new(Some(handle)),
            maker: Maker::this_process(),
        }
    }

    fn slot(&mut self) -> &mut Option<T> {
        self.slot.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&mut self) -> PyResult<&mut T> {
        self.maker.check()?;
        self.slot().as_mut().ok_or_else(closed)
    }

    fn close(&mut self, py: Python<'_>)
    where
        T: Send,
    {
        let handle = self.slot().take();
        unlocked(py, || drop(handle));
    }
}

#[pyclass(module = "hero_ril._native")]
struct Robot {
    ipc: Option<Ipc>,
    maker: Maker,
}

impl Robot {
    fn ipc(&self) -> PyResult<&Ipc> {
        self.maker.check()?;
        self.ipc.as_ref().ok_or_else(closed)
    }
}

#[pymethods]
impl Robot {
    #[new]
    #[pyo3(signature = (robot, name, root=None))]
    fn new(
        py: Python<'_>,
        robot: u32,
        name: &str,
        root: Option<std::path::PathBuf>,
    ) -> PyResult<Robot> {
        let ipc = unlocked(py, || {
            let domain = match root {
                Some(root) => Domain::new(&root)?,
                None => Domain::from_environment()?,
            };
            join(&domain, robot, name)
        });
        Ok(Robot {
            ipc: Some(ipc.map_err(raise)?),
            maker: Maker::this_process(),
        })
    }

    #[pyo3(signature = (key, layout_hash=None, schema=None, size=0))]
    fn subscribe(
        &self,
        py: Python<'_>,
        key: &str,
        layout_hash: Option<&str>,
        schema: Option<&str>,
        size: usize,
    ) -> PyResult<Subscriber> {
        let topic = ServiceName {
            key,
            layout_hash,
            schema,
            size,
        };
        let ipc = self.ipc()?;
        let subscriber = unlocked(py, || topic.subscriber(ipc)).map_err(raise)?;
        Ok(Subscriber {
            subscriber: Handle::new(subscriber),
            sample: Vec::new(),
        })
    }

    /// With `patience_s`, for a test, each sample waits up to so long for the subscribers.
    #[pyo3(signature = (key, schema=None, size=0, patience_s=None))]
    fn advertise(
        &self,
        py: Python<'_>,
        key: &str,
        schema: Option<&str>,
        size: usize,
        patience_s: Option<f64>,
    ) -> PyResult<Publisher> {
        let topic = ServiceName {
            key,
            layout_hash: None,
            schema,
            size,
        };
        let ipc = self.ipc()?;
        let is_over = Arc::<AtomicBool>::default();
        let patience = match patience_s {
            None => None,
            Some(_) => {
                let (limit, is_over) = (duration(patience_s)?, Arc::clone(&is_over));
                Some(Patience::new(move |waited| {
                    waited < limit && !is_over.load(Ordering::Relaxed)
                }))
            }
        };
        let is_patient = patience.is_some();
        unlocked(py, || {
            Publisher::new(topic.publisher(ipc, patience)?, is_patient, is_over)
        })
        .map_err(raise)
    }

    /// With `once` each request is handed on once, as a module serves it.
    #[pyo3(signature = (key, schema=None, size=0, once=false))]
    fn serve(
        &self,
        py: Python<'_>,
        key: &str,
        schema: Option<&str>,
        size: usize,
        once: bool,
    ) -> PyResult<Server> {
        let service = ServiceName {
            key,
            layout_hash: None,
            schema,
            size,
        };
        let ipc = self.ipc()?;
        let open = if once {
            Serving::open_once
        } else {
            Serving::open
        };
        let serving = unlocked(py, || open(ipc, &service)).map_err(raise)?;
        Ok(Server {
            serving: Mutex::new(Some(serving)),
            waits_on: OnceLock::new(),
            maker: Maker::this_process(),
        })
    }

    fn client(&self) -> PyResult<Client> {
        Ok(Client {
            requests: Handle::new(Requests::new(self.ipc()?)),
        })
    }

    /// Of every topic: key, type name, and the process that publishes it.
    fn topics(&self, py: Python<'_>) -> PyResult<Vec<(String, String, Option<String>)>> {
        let ipc = self.ipc()?;
        let topics = unlocked(py, || topics(ipc)).into_iter();
        Ok(topics
            .map(|topic| {
                let provider = topic.provider.map(|provider| provider.process.to_string());
                (topic.key, topic.schema.type_name().to_owned(), provider)
            })
            .collect())
    }

    fn close(&mut self, py: Python<'_>) {
        let ipc = self.ipc.take();
        unlocked(py, || drop(ipc));
    }
}

#[pyclass(module = "hero_ril._native")]
struct Subscriber {
    subscriber: Handle<DynamicSubscriber>,
    /// The sample that is on its way to Python: it can be received without Python's lock, but made an object only with
    /// it.
    sample: Vec<u8>,
}

#[pymethods]
impl Subscriber {
    /// The oldest sample that was not received yet, or nothing when the time is over.
    #[pyo3(signature = (timeout_s=None))]
    fn receive<'py>(
        &mut self,
        py: Python<'py>,
        timeout_s: Option<f64>,
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let (subscriber, buffer) = (self.subscriber.get()?, &mut self.sample);
        let received = wait(py, timeout_s, |slice| {
            let received = topic::receive(subscriber, slice, |sample| {
                buffer.clear();
                buffer.extend_from_slice(sample);
            })?;
            Ok((received == SampleWait::Sample).then_some(()))
        })?;
        Ok(received.map(|()| PyBytes::new(py, &self.sample)))
    }

    /// The newest sample that was not received yet.
    fn latest<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let buffer = &mut self.sample;
        let drained = self.subscriber.get()?.drain(|sample| {
            buffer.clear();
            buffer.extend_from_slice(sample);
        });
        let count = drained.map_err(|error| raise(error.into()))?;
        Ok((count > 0).then(|| PyBytes::new(py, &self.sample)))
    }

    /// All samples that are there, one after the other.
    fn drain<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let mut all = Vec::new();
        self.subscriber
            .get()?
            .drain(|sample| all.extend_from_slice(sample))
            .map_err(|error| raise(error.into()))?;
        Ok(PyBytes::new(py, &all))
    }

    /// Received, lost, joined late, repeated, restarts of the publisher.
    fn losses(&mut self) -> PyResult<(u64, u64, u64, u64, u64)> {
        let losses = self.subscriber.get()?.losses();
        Ok((
            losses.received,
            losses.lost,
            losses.joined_late,
            losses.repeated,
            losses.publisher_restarts,
        ))
    }

    fn descriptor(&mut self) -> PyResult<i32> {
        let descriptor = self.subscriber.get()?.descriptor();
        let descriptor = descriptor.map_err(|error| raise(error.into()))?;
        Ok(descriptor.as_raw_fd())
    }

    /// The struct: name, type name, and of each field its name, type (a number's name, or a struct of the same kind)
    /// and length.
    fn describe<'py>(&mut self, py: Python<'py>) -> PyResult<Description<'py>> {
        describe(py, self.subscriber.get()?.schema())
    }

    fn close(&mut self, py: Python<'_>) {
        self.subscriber.close(py);
    }
}

/// Name, type name and fields of a struct.
type Description<'py> = (String, String, Bound<'py, PyList>);

fn describe<'py>(py: Python<'py>, schema: &Schema) -> PyResult<Description<'py>> {
    let root = schema.root();
    let type_name = schema.type_name().to_owned();
    Ok((root.name.clone(), type_name, fields(py, root)?))
}

fn fields<'py>(py: Python<'py>, message: &Message) -> PyResult<Bound<'py, PyList>> {
    let list = PyList::empty(py);
    for field in &message.fields {
        match &field.kind {
            FieldKind::Number(number) => {
                list.append((&field.name, number.rust_name(), field.len))?;
            }
            FieldKind::Struct(nested) => {
                let nested = (nested.name.clone(), fields(py, nested)?);
                list.append((&field.name, nested, field.len))?;
            }
        }
    }
    Ok(list)
}

/// A publisher with a thread of its own, which gives the latest sample to subscribers that join.
#[pyclass(module = "hero_ril._native", frozen)]
struct Publisher {
    shared: Arc<Mutex<Option<DynamicPublisher>>>,
    /// Closed to end the thread.
    end: Mutex<Option<UnixStream>>,
    /// Publishing may wait for the subscribers, until it is over.
    is_patient: bool,
    is_over: Arc<AtomicBool>,
    maker: Maker,
}

impl Publisher {
    fn new(
        publisher: DynamicPublisher,
        is_patient: bool,
        is_over: Arc<AtomicBool>,
    ) -> Result<Publisher, Error> {
        let joins = publisher.descriptor()?.try_clone_to_owned();
        let failed = |error: std::io::Error| Error::Invalid(format!("no thread: {error}"));
        let (joins, (end, ended)) = (joins.map_err(failed)?, UnixStream::pair().map_err(failed)?);
        let shared = Arc::new(Mutex::new(Some(publisher)));
        let tended = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("hero-ril-tend".to_owned());
        let spawned = thread.spawn(move || {
            let waiter = Waiter::new();
            loop {
                let mut joins = Descriptor::new(joins.as_fd());
                let mut ended = Descriptor::new(ended.as_fd());
                let sources: &mut [(bool, &mut dyn Source)] =
                    &mut [(false, &mut joins), (true, &mut ended)];
                match waiter.wait(sources, None) {
                    Ok(wake) if !wake.has(true) => {}
                    _ => return,
                }
                match &mut *lock(&tended) {
                    Some(publisher) => publisher.service(),
                    None => return,
                }
            }
        });
        spawned.map_err(failed)?;
        Ok(Publisher {
            shared,
            end: Mutex::new(Some(end)),
            is_patient,
            is_over,
            maker: Maker::this_process(),
        })
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[pymethods]
impl Publisher {
    fn publish(&self, py: Python<'_>, sample: &[u8]) -> PyResult<u64> {
        self.maker.check()?;
        let publish = |publisher: &mut Option<DynamicPublisher>| {
            let publisher = publisher.as_mut().ok_or_else(closed)?;
            let size = publisher.schema().size();
            if sample.len() != size {
                return Err(LayoutError::new_err(format!(
                    "a sample has {size} bytes, {} were given",
                    sample.len()
                )));
            }
            publisher.service();
            publisher
                .publish(|bytes| bytes.copy_from_slice(sample))
                .map_err(|error| raise(error.into()))
        };
        // Python's lock is released only when the thread is at work just now, or subscribers are waited for.
        if !self.is_patient
            && let Ok(mut publisher) = self.shared.try_lock()
        {
            return publish(&mut publisher);
        }
        unlocked(py, || publish(&mut lock(&self.shared)))
    }

    fn close(&self, py: Python<'_>) {
        if self.maker.check().is_ok() {
            self.is_over.store(true, Ordering::Relaxed);
            unlocked(py, || {
                drop(lock(&self.end).take());
                drop(lock(&self.shared).take());
            });
        }
    }
}

#[pyclass(module = "hero_ril._native")]
struct Client {
    requests: Handle<Requests>,
}

impl Client {
    fn sent(
        &mut self,
        py: Python<'_>,
        send: impl FnOnce(&mut Requests) -> Result<u64, Error> + Send,
    ) -> PyResult<u64> {
        let requests = self.requests.get()?;
        unlocked(py, || send(requests)).map_err(raise)
    }
}

#[pymethods]
impl Client {
    #[pyo3(signature = (key, request, layout_hash=None, schema=None))]
    fn send(
        &mut self,
        py: Python<'_>,
        key: &str,
        request: &[u8],
        layout_hash: Option<&str>,
        schema: Option<&str>,
    ) -> PyResult<u64> {
        let service = ServiceName {
            key,
            layout_hash,
            schema,
            size: request.len(),
        };
        self.sent(py, |requests| requests.send(&service, request))
    }

    fn follow(&mut self, before: u64) -> PyResult<()> {
        self.requests.get()?.follow(before);
        Ok(())
    }

    fn start(&mut self, py: Python<'_>) -> PyResult<u64> {
        self.sent(py, |requests| requests.control(ControlCommand::Start))
    }

    fn stop(&mut self, py: Python<'_>) -> PyResult<u64> {
        self.sent(py, |requests| requests.control(ControlCommand::Stop))
    }

    fn take_off(&mut self, py: Python<'_>, altitude_m: f64) -> PyResult<u64> {
        self.sent(py, |requests| requests.take_off(altitude_m))
    }

    fn land(&mut self, py: Python<'_>, preempt: bool) -> PyResult<u64> {
        self.sent(py, |requests| requests.land(preempt))
    }

    fn hold(&mut self, py: Python<'_>) -> PyResult<u64> {
        self.sent(py, Requests::hold)
    }

    fn when_lost(&mut self, py: Python<'_>, action: u32, lease_ms: u32) -> PyResult<u64> {
        self.sent(py, |requests| {
            requests.when_lost(action, lease_ms).map(|()| 0)
        })
    }

    fn go_to(
        &mut self,
        py: Python<'_>,
        path: Vec<(f64, f64, f64)>,
        preempt: bool,
    ) -> PyResult<u64> {
        let path: Vec<_> = path
            .into_iter()
            .map(
                |(latitude_deg, longitude_deg, altitude_m)| WaypointPosition {
                    latitude_deg,
                    longitude_deg,
                    altitude_m,
                },
            )
            .collect();
        self.sent(py, |requests| requests.go_to(&path, preempt))
    }

    /// The oldest report about a request as bytes, and whether it is final; nothing when the time is over.
    #[pyo3(signature = (request_id, timeout_s=None))]
    fn next_report<'py>(
        &mut self,
        py: Python<'py>,
        request_id: u64,
        timeout_s: Option<f64>,
    ) -> PyResult<Option<(Bound<'py, PyBytes>, bool)>> {
        let requests = self.requests.get()?;
        let report = wait(py, timeout_s, |slice| {
            Ok(match requests.next_report(request_id, slice)? {
                ReportWait::Report(report) => Some(report),
                ReportWait::Nothing | ReportWait::Interrupted => None,
            })
        })?;
        Ok(report.map(|report| (PyBytes::new(py, report.bytes()), report.is_final())))
    }

    fn descriptors(&mut self) -> PyResult<Vec<i32>> {
        self.requests.get()?.descriptors().map_err(raise)
    }

    fn close(&mut self, py: Python<'_>) {
        self.requests.close(py);
    }
}

/// Can be used by several threads at a time: no call holds the mutex while it waits.
#[pyclass(module = "hero_ril._native", frozen)]
struct Server {
    serving: Mutex<Option<Serving>>,
    /// What a thread waits on that takes requests: the server's descriptor, which stays open while another thread
    /// closes the server.
    waits_on: OnceLock<OwnedFd>,
    maker: Maker,
}

impl Server {
    /// Uses the server. Python's lock is released first: the thread that has the mutex never waits for it, but this one
    /// may have to wait for the mutex.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut Serving) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        self.maker.check()?;
        let done = unlocked(py, || {
            let mut serving = self.serving.lock().unwrap_or_else(PoisonError::into_inner);
            serving.as_mut().map(act)
        });
        done.ok_or_else(closed)?.map_err(raise)
    }

    /// Sleeps until there may be something to take.
    fn wait(&self, py: Python<'_>, timeout: Duration) -> PyResult<()> {
        let descriptor = match self.waits_on.get() {
            Some(descriptor) => descriptor,
            None => {
                let descriptor = self.with(py, |serving| {
                    Ok(serving.server().descriptor()?.try_clone_to_owned())
                })??;
                self.waits_on.get_or_init(|| descriptor)
            }
        };
        let waited = unlocked(py, || {
            let mut descriptor = Descriptor::new(descriptor.as_fd());
            Waiter::new().wait(&mut [((), &mut descriptor)], Some(timeout))
        });
        waited.map_err(|error| raise(error.into()))?;
        py.check_signals()
    }
}

#[pymethods]
impl Server {
    /// The next event: a ticket with the request's bytes, or with `None` when the client of that request has ended.
    /// `None` when the time is over.
    #[pyo3(signature = (timeout_s=None))]
    fn take<'py>(
        &self,
        py: Python<'py>,
        timeout_s: Option<f64>,
    ) -> PyResult<Option<(u64, Option<Bound<'py, PyBytes>>)>> {
        let deadline = Instant::now() + duration(timeout_s)?;
        loop {
            match self.with(py, |serving| serving.take(Duration::ZERO))? {
                ServingEvent::Request(ticket, request) => {
                    return Ok(Some((ticket.to_bits(), Some(PyBytes::new(py, &request)))));
                }
                ServingEvent::Gone(ticket) => return Ok(Some((ticket.to_bits(), None))),
                ServingEvent::Nothing | ServingEvent::Interrupted => {}
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            self.wait(py, left.min(SLICE))?;
        }
    }

    /// Answers a request by a report's bytes: `sent`, `dropped` or `gone`.
    fn report(&self, py: Python<'_>, ticket: u64, report: &[u8]) -> PyResult<&'static str> {
        let report = RequestReport::from_bytes(report)
            .ok_or_else(|| LayoutError::new_err("it is no RequestReport"))?;
        let ticket = Ticket::from_bits(ticket);
        Ok(
            match self.with(py, |serving| serving.report(ticket, &report))? {
                Reported::Sent => "sent",
                Reported::Dropped => "dropped",
                Reported::Gone => "gone",
            },
        )
    }

    fn descriptor(&self, py: Python<'_>) -> PyResult<i32> {
        self.with(py, |serving| Ok(serving.server().descriptor()?.as_raw_fd()))
    }

    fn close(&self, py: Python<'_>) {
        if self.maker.check().is_err() {
            return;
        }
        unlocked(py, || {
            let serving = self
                .serving
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take();
            drop(serving);
        });
    }
}

/// A module: its rules, state and control, and its one wait.
#[pyclass(module = "hero_ril._native")]
struct Module {
    module: Handle<OwnModule>,
}

#[pymethods]
impl Module {
    /// Begins as the module's command line says, and joins its robot: that, and the module. `check` gets the
    /// configuration as JSON, and returns None, or the keys that lead to a wrong value and what is wrong. Raises
    /// `SystemExit` after printing why the process ends.
    #[staticmethod]
    fn begin(
        py: Python<'_>,
        name: &str,
        id: u32,
        words: Vec<OsString>,
        check: &Bound<'_, PyAny>,
    ) -> PyResult<(Robot, Module)> {
        // Once in a process.
        let leaked: &'static str = name.to_owned().leak();
        let args = module_kit::options(leaked, words)
            .map_err(|error| SystemExit::new_err(exit::usage(&error)))?;
        let mut raised = None;
        let set_up =
            SetUp::<toml::Table>::begin_with(&args, &format!("{name}.toml"), |configuration| {
                fault_of(check, configuration).unwrap_or_else(|error| {
                    let fault = Fault::at(&[], error.to_string());
                    raised = Some(error);
                    Err(fault)
                })
            });
        if let Some(error) = raised {
            return Err(error);
        }
        let set_up = set_up.map_err(end)?.ok_or_else(|| {
            output::finish("");
            SystemExit::new_err(ExitCode::Ok.code())
        })?;
        let ipc = unlocked(py, || join(&set_up.domain, set_up.robot.get(), name));
        let ipc = ipc.map_err(|error| end(Failure::internal(error)))?;
        let module = Module::of(py, &ipc, name, id, Some(set_up.termination));
        let robot = Robot {
            ipc: Some(ipc),
            maker: Maker::this_process(),
        };
        Ok((
            robot,
            module.map_err(|error| end(Failure::internal(error)))?,
        ))
    }

    /// Without a command line and without signals: within another program.
    #[new]
    fn new(py: Python<'_>, robot: &Robot, name: &str, id: u32) -> PyResult<Module> {
        Module::of(py, robot.ipc()?, name, id, None).map_err(raise)
    }

    /// Sleeps until the descriptor can be read, something happens with the module, or the time is over: which of them.
    #[pyo3(signature = (descriptor, timeout_s=None))]
    fn wait(
        &mut self,
        py: Python<'_>,
        descriptor: i32,
        timeout_s: Option<f64>,
    ) -> PyResult<&'static str> {
        let (module, timeout) = (self.module.get()?, duration(timeout_s)?);
        let event = unlocked(py, || {
            let mut descriptor = borrowed(descriptor)?;
            module.wait(&mut [&mut descriptor], timeout)
        });
        let event = event.map_err(raise)?;
        py.check_signals()?;
        Ok(match event {
            Event::Ready => "ready",
            Event::TimedOut => "time",
            Event::Interrupted => "signal",
            Event::Started => "started",
            Event::Stopped => "stopped",
            Event::Ending => "ending",
        })
    }

    /// Whether the module is `started`, `ready` or `working`.
    fn is_so(&mut self, what: &str) -> PyResult<bool> {
        let manager = self.module.get()?.manager();
        Ok(match what {
            "ready" => manager.is_ready(),
            "working" => manager.is_working(),
            _ => manager.is_started(),
        })
    }

    fn work(&mut self, functionality: u32, doing: &str, on_stop: &str) -> PyResult<bool> {
        let on_stop = match on_stop {
            "aborts" => OnStop::Aborts,
            "ends" => OnStop::Ends,
            "refused" => OnStop::Refused,
            _ => {
                return Err(PyValueError::new_err(format!(
                    "`{on_stop}` is none of aborts, ends, refused"
                )));
            }
        };
        let manager = self.module.get()?.manager();
        Ok(manager.begin(MonotonicNs::now(), functionality, doing, on_stop))
    }

    fn done(&mut self) -> PyResult<()> {
        self.module.get()?.manager().done(MonotonicNs::now());
        Ok(())
    }

    fn fail(&mut self, error: u32) -> PyResult<()> {
        self.module.get()?.manager().fail(MonotonicNs::now(), error);
        Ok(())
    }

    fn close(&mut self, py: Python<'_>) {
        self.module.close(py);
        // The interpreter does not wait for threads that are not its own.
        unlocked(py, || output::finish(""));
    }
}

impl Module {
    fn of(
        py: Python<'_>,
        ipc: &Ipc,
        name: &str,
        id: u32,
        termination: Option<Termination>,
    ) -> Result<Module, Error> {
        let module = unlocked(py, || OwnModule::open(ipc, name, id, termination))?;
        Ok(Module {
            module: Handle::new(module),
        })
    }
}

/// Prints why the process ends, and is the exception that ends it.
fn end(failure: Failure) -> PyErr {
    let code = failure.code().code();
    exit::main_with(|| Err(failure));
    SystemExit::new_err(code)
}

/// What `check` says about a configuration.
fn fault_of(check: &Bound<'_, PyAny>, configuration: &toml::Table) -> PyResult<Result<(), Fault>> {
    let configuration = serde_json::to_string(configuration)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    let said = check.call1((configuration,))?;
    let said: Option<(Vec<String>, String)> = said.extract()?;
    Ok(match said {
        None => Ok(()),
        Some((keys, reason)) => {
            // Once in a process, which ends after it.
            let keys: Vec<&'static str> = keys.into_iter().map(|key| &*key.leak()).collect();
            Err(Fault::at(keys.leak(), reason))
        }
    })
}

/// A descriptor that Python has open.
fn borrowed<'fd>(descriptor: i32) -> Result<Descriptor<'fd>, Error> {
    if descriptor < 0 {
        return Err(Error::Invalid(format!("{descriptor} is no descriptor")));
    }
    // SAFETY: the caller keeps it open for the wait; one that is closed is an error of the wait.
    #[allow(unsafe_code)]
    Ok(Descriptor::new(unsafe {
        BorrowedFd::borrow_raw(descriptor)
    }))
}

/// Sleeps until the descriptor can be read or the time is over.
#[pyfunction]
#[pyo3(signature = (descriptor, timeout_s=None))]
fn wait_for(py: Python<'_>, descriptor: i32, timeout_s: Option<f64>) -> PyResult<bool> {
    let is_ready = wait(py, timeout_s, |slice| {
        let mut descriptor = borrowed(descriptor)?;
        let wake = Waiter::new().wait(&mut [((), &mut descriptor)], Some(slice))?;
        Ok(wake.is_ready().then_some(()))
    })?;
    Ok(is_ready.is_some())
}

/// What is there of the shared memory `root`: for tests.
#[pyfunction]
fn residue(py: Python<'_>, root: std::path::PathBuf) -> PyResult<Vec<std::path::PathBuf>> {
    let found = unlocked(py, || Ok(Domain::new(&root)?.residue()));
    found.map_err(|error: Error| raise(error))
}

/// Removes of the shared memory `root` what no live process uses: for tests.
#[pyfunction]
fn sweep(py: Python<'_>, root: std::path::PathBuf) -> PyResult<()> {
    let swept = unlocked(py, || {
        Ok(Domain::new(&root)?.remove_if_dead().map(|_| ())?)
    });
    swept.map_err(|error: Error| raise(error))
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    output::bound_panics();
    module.add_class::<Robot>()?;
    module.add_class::<Subscriber>()?;
    module.add_class::<Publisher>()?;
    module.add_class::<Client>()?;
    module.add_class::<Server>()?;
    module.add_class::<Module>()?;
    let py = module.py();
    module.add("RilError", py.get_type::<RilError>())?;
    module.add("LayoutError", py.get_type::<LayoutError>())?;
    module.add("NotThereError", py.get_type::<NotThereError>())?;
    module.add("TakenError", py.get_type::<TakenError>())?;
    module.add("FullError", py.get_type::<FullError>())?;
    module.add_function(wrap_pyfunction!(count_fork, module)?)?;
    module.add_function(wrap_pyfunction!(request_slice, module)?)?;
    module.add_function(wrap_pyfunction!(wait_for, module)?)?;
    module.add_function(wrap_pyfunction!(residue, module)?)?;
    module.add_function(wrap_pyfunction!(sweep, module)?)?;
    module.add_function(wrap_pyfunction!(stage, module)?)?;
    module.add_function(wrap_pyfunction!(reason, module)?)?;
    module.add_function(wrap_pyfunction!(stage_code, module)?)?;
    module.add_function(wrap_pyfunction!(reason_code, module)?)?;
    Ok(())
}

/// Asks Linux for a slice of the calling thread's processor as `role` has it.
#[pyfunction]
fn request_slice(role: &str) -> PyResult<()> {
    ipc_types::request_slice(match role {
        "provider" => SchedulingRole::Provider,
        "consumer" => SchedulingRole::Consumer,
        "background" => SchedulingRole::Background,
        _ => return Err(PyValueError::new_err(format!("`{role}` is no role"))),
    });
    Ok(())
}

/// Name of a stage, such as `done`.
#[pyfunction]
fn stage(code: u32) -> &'static str {
    stage_name(code)
}

/// Name of a reason, such as `not-flying`.
#[pyfunction]
fn reason(code: u32) -> &'static str {
    reason_name(code)
}

/// Number of a stage by its name.
#[pyfunction]
fn stage_code(name: &str) -> PyResult<u32> {
    let stage = Stage::ALL.iter().find(|stage| stage.name() == name);
    stage
        .map(|stage| stage.code())
        .ok_or_else(|| PyValueError::new_err(format!("`{name}` is no stage")))
}

/// Number of a reason by its name.
#[pyfunction]
fn reason_code(name: &str) -> PyResult<u32> {
    let reason = Reason::ALL.iter().find(|reason| reason.name() == name);
    reason
        .map(|reason| reason.code())
        .ok_or_else(|| PyValueError::new_err(format!("`{name}` is no reason")))
}
