//! `hero_ril._native`: what the Python package needs of the library. Bytes and numbers only; structs are made in Python.
//!
//! Every wait releases Python's lock, and lets Python run its signal handlers. A handle that one thread waits with is busy for
//! the others: pyo3 then raises `RuntimeError`. A panic becomes `PanicException`.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use hero_ril::error::{Error, Kind};
use hero_ril::joining::join;
use hero_ril::requests::{Answer, Requests, reason_name, stage_name};
use hero_ril::service::ServiceName;
use hero_ril::serving::{Order, Reported, Serving};
use hero_ril::topic::{self, FOREVER, Received};
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::dynamic::topics;
use ipc_types::payload::{RequestReport, SharedStruct, WaypointPosition};
use ipc_types::schema::{Kind as FieldKind, Message};
use ipc_types::{Domain, DynamicPublisher, DynamicSubscriber, Ipc, Schema, Ticket};
use pyo3::exceptions::PyValueError;
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
        Kind::Invalid => PyValueError::new_err(text),
        Kind::Layout => LayoutError::new_err(text),
        Kind::NotThere => NotThereError::new_err(text),
        Kind::Taken => TakenError::new_err(text),
        Kind::Full => FullError::new_err(text),
        Kind::Failed | Kind::Panic => RilError::new_err(text),
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
        if let Some(found) = py.detach(|| attempt(slice)).map_err(raise)? {
            return Ok(Some(found));
        }
        py.check_signals()?;
    }
}

/// A handle that Python may name from every thread. It is used only through `&mut`, so nothing is ever locked; the mutex stands
/// for that towards the compiler.
struct Handle<T>(Mutex<Option<T>>);

impl<T> Handle<T> {
    fn new(handle: T) -> Handle<T> {
        Handle(Mutex::new(Some(handle)))
    }

    fn slot(&mut self) -> &mut Option<T> {
        self.0.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&mut self) -> PyResult<&mut T> {
        self.slot().as_mut().ok_or_else(closed)
    }
}

#[pyclass(module = "hero_ril._native")]
struct Robot {
    ipc: Option<Ipc>,
}

impl Robot {
    fn ipc(&self) -> PyResult<&Ipc> {
        self.ipc.as_ref().ok_or_else(closed)
    }
}

#[pymethods]
impl Robot {
    #[new]
    #[pyo3(signature = (robot, name, root=None))]
    fn new(robot: u32, name: &str, root: Option<std::path::PathBuf>) -> PyResult<Robot> {
        let domain = match root {
            Some(root) => Domain::new(&root),
            None => Domain::from_environment(),
        };
        let domain = domain.map_err(|error| raise(error.into()))?;
        let ipc = join(&domain, robot, name).map_err(raise)?;
        Ok(Robot { ipc: Some(ipc) })
    }

    #[pyo3(signature = (key, layout_hash=None, schema=None, size=0))]
    fn subscribe(
        &self,
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
        let subscriber = topic.subscriber(self.ipc()?).map_err(raise)?;
        Ok(Subscriber {
            subscriber: Handle::new(subscriber),
            sample: Vec::new(),
        })
    }

    #[pyo3(signature = (key, schema=None, size=0))]
    fn advertise(&self, key: &str, schema: Option<&str>, size: usize) -> PyResult<Publisher> {
        let topic = ServiceName {
            key,
            layout_hash: None,
            schema,
            size,
        };
        let publisher = topic.publisher(self.ipc()?).map_err(raise)?;
        Ok(Publisher {
            publisher: Handle::new(publisher),
        })
    }

    #[pyo3(signature = (key, layout_hash=None, schema=None, size=0))]
    fn serve(
        &self,
        key: &str,
        layout_hash: Option<&str>,
        schema: Option<&str>,
        size: usize,
    ) -> PyResult<Server> {
        let service = ServiceName {
            key,
            layout_hash,
            schema,
            size,
        };
        let serving = Serving::open(self.ipc()?, &service).map_err(raise)?;
        Ok(Server {
            serving: Handle::new(serving),
        })
    }

    fn client(&self) -> PyResult<Client> {
        Ok(Client {
            requests: Handle::new(Requests::new(self.ipc()?)),
        })
    }

    /// Of every topic: key, type name, and the process that publishes it.
    fn topics(&self) -> PyResult<Vec<(String, String, Option<String>)>> {
        let topics = topics(self.ipc()?).into_iter();
        Ok(topics
            .map(|topic| {
                let provider = topic.provider.map(|provider| provider.process.to_string());
                (topic.key, topic.schema.type_name().to_owned(), provider)
            })
            .collect())
    }

    fn close(&mut self) {
        self.ipc = None;
    }
}

#[pyclass(module = "hero_ril._native")]
struct Subscriber {
    subscriber: Handle<DynamicSubscriber>,
    /// The sample that is on its way to Python: it can be received without Python's lock, but made an object only with it.
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
            Ok((received == Received::Sample).then_some(()))
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

    /// Received, lost, repeated, restarts of the publisher.
    fn losses(&mut self) -> PyResult<(u64, u64, u64, u64)> {
        let losses = self.subscriber.get()?.losses();
        Ok((
            losses.received,
            losses.lost,
            losses.repeated,
            losses.publisher_restarts,
        ))
    }

    fn descriptor(&mut self) -> PyResult<i32> {
        use std::os::fd::AsRawFd;
        let descriptor = self.subscriber.get()?.descriptor();
        let descriptor = descriptor.map_err(|error| raise(error.into()))?;
        Ok(descriptor.as_raw_fd())
    }

    /// The struct: name, type name, and of each field its name, type (a number's name, or a struct of the same kind) and length.
    fn describe<'py>(&mut self, py: Python<'py>) -> PyResult<Description<'py>> {
        describe(py, self.subscriber.get()?.schema())
    }

    fn close(&mut self) {
        *self.subscriber.slot() = None;
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

#[pyclass(module = "hero_ril._native")]
struct Publisher {
    publisher: Handle<DynamicPublisher>,
}

#[pymethods]
impl Publisher {
    fn publish(&mut self, sample: &[u8]) -> PyResult<u64> {
        let publisher = self.publisher.get()?;
        let size = publisher.schema().size();
        if sample.len() != size {
            return Err(LayoutError::new_err(format!(
                "a sample has {size} bytes, {} were given",
                sample.len()
            )));
        }
        publisher.tend();
        publisher
            .publish(|bytes| bytes.copy_from_slice(sample))
            .map_err(|error| raise(error.into()))
    }

    fn tend(&mut self) -> PyResult<()> {
        self.publisher.get()?.tend();
        Ok(())
    }

    fn close(&mut self) {
        *self.publisher.slot() = None;
    }
}

#[pyclass(module = "hero_ril._native")]
struct Client {
    requests: Handle<Requests>,
}

impl Client {
    fn requests(&mut self) -> PyResult<&mut Requests> {
        self.requests.get()
    }
}

#[pymethods]
impl Client {
    #[pyo3(signature = (key, request, layout_hash=None, schema=None))]
    fn send(
        &mut self,
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
        self.requests()?.send(&service, request).map_err(raise)
    }

    fn start(&mut self) -> PyResult<u64> {
        self.requests()?
            .control(ControlCommand::Start)
            .map_err(raise)
    }

    fn stop(&mut self) -> PyResult<u64> {
        self.requests()?
            .control(ControlCommand::Stop)
            .map_err(raise)
    }

    fn take_off(&mut self, altitude_m: f64) -> PyResult<u64> {
        self.requests()?.take_off(altitude_m).map_err(raise)
    }

    fn land(&mut self, preempt: bool) -> PyResult<u64> {
        self.requests()?.land(preempt).map_err(raise)
    }

    fn hold(&mut self) -> PyResult<u64> {
        self.requests()?.hold().map_err(raise)
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
        let requests = self.requests()?;
        py.detach(|| requests.go_to(&path, preempt)).map_err(raise)
    }

    /// The oldest report about a request as bytes, and whether it is final; nothing when the time is over.
    #[pyo3(signature = (request_id, timeout_s=None))]
    fn next_report<'py>(
        &mut self,
        py: Python<'py>,
        request_id: u64,
        timeout_s: Option<f64>,
    ) -> PyResult<Option<(Bound<'py, PyBytes>, bool)>> {
        let requests = self.requests()?;
        let report = wait(py, timeout_s, |slice| {
            Ok(match requests.next_report(request_id, slice)? {
                Answer::Report(report) => Some(report),
                Answer::Nothing | Answer::Interrupted => None,
            })
        })?;
        Ok(report.map(|report| (PyBytes::new(py, report.bytes()), report.is_final())))
    }

    fn descriptors(&mut self) -> PyResult<Vec<i32>> {
        self.requests()?.descriptors().map_err(raise)
    }

    fn close(&mut self) {
        *self.requests.slot() = None;
    }
}

#[pyclass(module = "hero_ril._native")]
struct Server {
    serving: Handle<Serving>,
}

#[pymethods]
impl Server {
    /// What is to be done next: a ticket, and the request's bytes, or none when its client is gone. Nothing when the time is over.
    #[pyo3(signature = (timeout_s=None))]
    fn take<'py>(
        &mut self,
        py: Python<'py>,
        timeout_s: Option<f64>,
    ) -> PyResult<Option<(u64, Option<Bound<'py, PyBytes>>)>> {
        let serving = self.serving.get()?;
        let order = wait(py, timeout_s, |slice| {
            Ok(match serving.take(slice)? {
                Order::Request(ticket, request) => Some((ticket, Some(request))),
                Order::Gone(ticket) => Some((ticket, None)),
                Order::Nothing | Order::Interrupted => None,
            })
        })?;
        Ok(order.map(|(ticket, request)| {
            let request = request.map(|request| PyBytes::new(py, &request));
            (ticket.to_bits(), request)
        }))
    }

    /// Answers a request by a report's bytes: `sent`, `dropped` or `gone`.
    fn report(&mut self, ticket: u64, report: &[u8]) -> PyResult<&'static str> {
        let report = RequestReport::from_bytes(report)
            .ok_or_else(|| LayoutError::new_err("it is no RequestReport"))?;
        let serving = self.serving.get()?;
        let reported = serving.report(Ticket::from_bits(ticket), &report);
        Ok(match reported.map_err(raise)? {
            Reported::Sent => "sent",
            Reported::Dropped => "dropped",
            Reported::Gone => "gone",
        })
    }

    fn descriptor(&mut self) -> PyResult<i32> {
        use std::os::fd::AsRawFd;
        let descriptor = self.serving.get()?.server().descriptor();
        let descriptor = descriptor.map_err(|error| raise(error.into()))?;
        Ok(descriptor.as_raw_fd())
    }

    /// As that of a subscriber.
    fn describe<'py>(&mut self, py: Python<'py>) -> PyResult<Description<'py>> {
        describe(py, self.serving.get()?.server().schema())
    }

    fn close(&mut self) {
        *self.serving.slot() = None;
    }
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Robot>()?;
    module.add_class::<Subscriber>()?;
    module.add_class::<Publisher>()?;
    module.add_class::<Client>()?;
    module.add_class::<Server>()?;
    let py = module.py();
    module.add("RilError", py.get_type::<RilError>())?;
    module.add("LayoutError", py.get_type::<LayoutError>())?;
    module.add("NotThereError", py.get_type::<NotThereError>())?;
    module.add("TakenError", py.get_type::<TakenError>())?;
    module.add("FullError", py.get_type::<FullError>())?;
    module.add_function(wrap_pyfunction!(stage, module)?)?;
    module.add_function(wrap_pyfunction!(reason, module)?)?;
    module.add_function(wrap_pyfunction!(stage_code, module)?)?;
    module.add_function(wrap_pyfunction!(reason_code, module)?)?;
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
