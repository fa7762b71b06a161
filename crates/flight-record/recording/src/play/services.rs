//! [`PlayedServices`]: the services of a robot that is played.

use std::sync::Arc;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{ModuleControl, MovementData, ParameterRequest, RequestReport};
use ipc_types::{
    DynamicError, DynamicPublisher, Ipc, MonotonicNs, OpenError, PublishError, Request, Schema,
    ServeError, Server, ServiceId, Source, Ticket,
};

use super::flight::{LeftOut, PlayableFlight, PlayedContent};
use super::player::Due;

/// What the process is called that provides the services: consumers that look for it see that this is no robot.
pub const PROCESS: &str = "replay";

/// A robot cannot be played here.
#[derive(Debug, thiserror::Error)]
pub enum ServicesError {
    /// A topic cannot be published. When another process lives that does so, [`OpenError::AlreadyProvided`] in it names
    /// that.
    #[error(transparent)]
    Topic(#[from] DynamicError),
    /// Requests cannot be taken.
    #[error(transparent)]
    Requests(#[from] OpenError),
}

/// The services of a robot that is played: every topic of the recording, and the bridge's request services, which
/// refuse all.
pub struct PlayedServices {
    flight: Arc<PlayableFlight>,
    /// At the places of the flight's topics; `None` for those that are left out.
    topics: Vec<Option<ServedTopic>>,
    left_out: Vec<LeftOut>,
    control: Refusing<ModuleControl>,
    movement: Refusing<MovementData>,
    parameters: Refusing<ParameterRequest>,
}

struct ServedTopic {
    publisher: DynamicPublisher,
    /// Offset of the field by which the bridge's state says that it is replayed; nothing in other topics.
    replayed: Option<usize>,
}

impl PlayedServices {
    /// Provides all services. A topic that this version of the RIL cannot publish is [left
    /// out](PlayedServices::left_out).
    ///
    /// # Errors
    /// See [`ServicesError`].
    pub fn open(flight: &Arc<PlayableFlight>, ipc: &Ipc) -> Result<PlayedServices, ServicesError> {
        // Requests first: what says that a robot lives is whether its movements are served.
        let (control, movement, parameters) = (
            Refusing::open(ipc)?,
            Refusing::open(ipc)?,
            Refusing::open(ipc)?,
        );
        let mut services = PlayedServices {
            flight: Arc::clone(flight),
            topics: Vec::new(),
            left_out: Vec::new(),
            control,
            movement,
            parameters,
        };
        for played in flight.topics() {
            let topic = match DynamicPublisher::open(ipc, &played.key, &played.schema_text) {
                Ok(publisher) => Some(ServedTopic {
                    replayed: replayed_offset(&played.key, publisher.schema()),
                    publisher,
                }),
                Err(error @ DynamicError::Open(_)) => return Err(error.into()),
                Err(error) => {
                    services.left_out.push(LeftOut {
                        topic: played.topic.clone(),
                        reason: error.to_string(),
                    });
                    None
                }
            };
            services.topics.push(topic);
        }
        Ok(services)
    }

    /// Topics of the flight that are not published, and why.
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    /// Publishes a message that is due, if it is a sample, with its moments moved to now. Says whether it was
    /// published.
    ///
    /// # Errors
    /// See [`PublishError`].
    pub fn publish(&mut self, due: &Due, now: MonotonicNs) -> Result<bool, PublishError> {
        let Some(PlayedContent::Sample(index, sample)) = self.flight.content(due.index) else {
            return Ok(false);
        };
        let Some(Some(topic)) = self.topics.get_mut(index) else {
            return Ok(false);
        };
        let moments = &self.flight.topics()[index].moments;
        let replayed = topic.replayed;
        topic.publisher.publish(|bytes| {
            bytes.copy_from_slice(sample);
            due.timeline.translate(bytes, moments, now);
            if let Some(flag) = replayed.and_then(|offset| bytes.get_mut(offset..offset + 4)) {
                flag.copy_from_slice(&1_u32.to_ne_bytes());
            }
        })?;
        Ok(true)
    }

    /// Gives late subscribers the latest samples, and refuses the requests that came. Returns how many those were.
    pub fn service(&mut self) -> usize {
        for topic in self.topics.iter_mut().flatten() {
            topic.publisher.service();
        }
        self.control.refuse() + self.movement.refuse() + self.parameters.refuse()
    }

    /// What to wait for: requests, and as many topics as there is room for in a wait beside `others` sources.
    /// Subscribers that join one of the other topics get its latest sample at the next
    /// [`service`](PlayedServices::service).
    pub fn sources(&mut self, others: usize) -> Vec<&mut dyn Source> {
        let mut sources: Vec<&mut dyn Source> = vec![
            &mut self.control.server,
            &mut self.movement.server,
            &mut self.parameters.server,
        ];
        let room = ipc_types::waiter::MAX_SOURCES.saturating_sub(sources.len() + others);
        for topic in self.topics.iter_mut().flatten().take(room) {
            sources.push(&mut topic.publisher);
        }
        sources
    }
}

/// The server of a request service that does nothing.
struct Refusing<R: Request> {
    server: Server<R>,
}

impl<R: Request> Refusing<R> {
    fn open(ipc: &Ipc) -> Result<Refusing<R>, OpenError> {
        let server = ipc.server()?;
        Ok(Refusing { server })
    }

    fn refuse(&mut self) -> usize {
        let mut came: Vec<(Ticket, u64)> = Vec::new();
        self.server.vanished(|_, _| {});
        let drained: Result<usize, ServeError> = self
            .server
            .drain(|ticket, request| came.push((ticket, request.path_id())));
        // What cannot be received now is tried again at the next wake; a client that is gone needs no answer.
        let _ = drained;
        for (ticket, path_id) in &came {
            let report = RequestReport {
                path_id: *path_id,
                ..RequestReport::new(Stage::Refused, Reason::Replayed)
            };
            let _ = self.server.report(*ticket, &report);
        }
        came.len()
    }
}

/// Where the bridge's state says that it is replayed.
fn replayed_offset(key: &str, schema: &Schema) -> Option<usize> {
    let is_state = key == ServiceId::ModuleState.key();
    let leaf = schema.number("safety.reserved").filter(|_| is_state)?;
    Some(leaf.offset)
}
