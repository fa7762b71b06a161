//! [`RequestHandle`]: one request that was sent, its progress and its result.

use std::collections::VecDeque;
use std::time::Duration;

use crate::bytes_client::{BytesClient, MAX_KEPT, keep_report};
use crate::client_port::SendError;
use crate::payload::RequestReport;
use crate::service::{REQUEST_ID_OFFSET, word};
use crate::time::MonotonicNs;
use crate::waiter::WaitError;

/// A request that was sent: what an action's goal handle is in ROS 2. [`Client::request`](crate::Client::request) makes it.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let robot = ipc_types::Ipc::connect("operator")?;
/// # let mut client = robot.client::<ipc_types::payload::MovementData>()?;
/// # let order = ipc_types::payload::MovementData::land(ipc_types::fresh_request_id());
/// let mut landing = client.request(&order)?;
/// for feedback in landing.feedback() {
///     println!("{} waypoints reached", feedback?.waypoints_reached);
/// }
/// println!("{:?}", landing.result()?.stage());
/// # Ok(())
/// # }
/// ```
///
/// **Dropping it before the result gives the request up**: a request that its server has not read is then not carried out, and
/// the server of one that it has read sees its client as vanished. The bridge flies an accepted movement to its end all the same
/// (docs/ipc.md, section 4). Reports about other requests of the client are kept for [`Client::drain`](crate::Client::drain).
pub struct RequestHandle<'c> {
    client: &'c mut BytesClient,
    request_id: u64,
    /// Reports about this request that were not handed on yet.
    reports: VecDeque<RequestReport>,
    /// Reports about other requests.
    others: VecDeque<RequestReport>,
    /// The final report, once it was handed on.
    result: Option<RequestReport>,
}

impl<'c> RequestHandle<'c> {
    /// Sends the bytes of a request to follow it alone.
    pub(crate) fn send(
        client: &'c mut BytesClient,
        request: &[u8],
    ) -> Result<RequestHandle<'c>, SendError> {
        client.send(request)?;
        Ok(RequestHandle {
            request_id: word(request, REQUEST_ID_OFFSET),
            reports: VecDeque::new(),
            // Taken out, so that they do not end the handle's waits.
            others: std::mem::take(client.kept()),
            result: None,
            client,
        })
    }

    /// Id of the request.
    pub fn request_id(&self) -> u64 {
        self.request_id
    }

    /// The next report, the final one included; nothing when none is there, or the final one was handed on.
    pub fn try_recv(&mut self) -> Option<RequestReport> {
        if self.reports.is_empty() && self.result.is_none() {
            let (id, reports, others) = (self.request_id, &mut self.reports, &mut self.others);
            self.client.receive(|report| match report.request_id == id {
                true => reports.push_back(*report),
                false => keep_report(others, *report, MAX_KEPT),
            });
        }
        let report = self.reports.pop_front()?;
        if report.is_final() {
            self.result = Some(report);
            self.reports.clear();
        }
        Some(report)
    }

    /// As [`RequestHandle::try_recv`], but sleeps until there is a report or `timeout` has passed. A signal does not end it.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn recv_timeout(&mut self, timeout: Duration) -> Result<Option<RequestReport>, WaitError> {
        let deadline = MonotonicNs::now() + timeout;
        loop {
            if let Some(report) = self.try_recv() {
                return Ok(Some(report));
            }
            let now = MonotonicNs::now();
            if self.result.is_some() || now >= deadline {
                return Ok(None);
            }
            self.client.wait(deadline.since(now))?;
        }
    }

    /// The reports before the final one, as they come. Sleeps while there is none, and ends with the result.
    pub fn feedback(&mut self) -> impl Iterator<Item = Result<RequestReport, WaitError>> {
        std::iter::from_fn(|| {
            self.recv_timeout(Duration::MAX)
                .map(|report| report.filter(|report| !report.is_final()))
                .transpose()
        })
    }

    /// Waits for the final report, and drops what comes before it. The report says *unknown, bridge-gone* when the server is gone.
    /// While a live server does not answer there is no end to it: [`RequestHandle::result_timeout`] has one.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn result(&mut self) -> Result<RequestReport, WaitError> {
        loop {
            if let Some(result) = self.result_timeout(Duration::MAX)? {
                return Ok(result);
            }
        }
    }

    /// As [`RequestHandle::result`], but waits no longer than `timeout`; nothing when there is no result by then.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn result_timeout(
        &mut self,
        timeout: Duration,
    ) -> Result<Option<RequestReport>, WaitError> {
        let deadline = MonotonicNs::now() + timeout;
        while self.result.is_none() {
            let left = deadline.since(MonotonicNs::now());
            if self.recv_timeout(left)?.is_none() {
                break;
            }
        }
        Ok(self.result)
    }
}

impl Drop for RequestHandle<'_> {
    fn drop(&mut self) {
        if self.result.is_none() {
            self.client.give_up_one(self.request_id);
        }
        *self.client.kept() = std::mem::take(&mut self.others);
    }
}
