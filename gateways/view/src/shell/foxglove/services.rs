//! [`Services`]: orders of Foxglove clients. They go the way of those from pages, and are answered at the bridge's
//! first report. A refusal is a normal answer, because some clients wait for ever when a call fails.

use std::collections::BTreeMap;

use ipc_types::MonotonicNs;
use operator::config::RequestConfig;
use serde::Deserialize;
use serde_json::json;

use crate::page::{OrderKind, OrderReport, OrderRequest, OrderStage};
use crate::shell::fleet::Fleet;
use crate::shell::orders::{GivenOrder, Orders};
use crate::{Call, OfferedService, Server};

/// What every robot is offered: name, order, JSON Schema of the request's properties, those that it must have.
const SERVICES: [(&str, OrderKind, &str, &str); 6] = [
    ("hold", OrderKind::Hold, "", ""),
    ("land", OrderKind::Land, "", ""),
    (
        "take_off",
        OrderKind::Takeoff,
        r#""height_m":{"type":"number","description":"above take-off"}"#,
        r#""height_m""#,
    ),
    (
        "go_to",
        OrderKind::Goto,
        r#""latitude_deg":{"type":"number"},"longitude_deg":{"type":"number"},"altitude_m":{"type":"number","description":"with the zero of telemetry"}"#,
        r#""latitude_deg","longitude_deg","altitude_m""#,
    ),
    ("start", OrderKind::Start, "", ""),
    (
        "stop",
        OrderKind::Stop,
        r#""confirm":{"type":"string","description":"the word stop","default":"stop"}"#,
        r#""confirm""#,
    ),
];

/// JSON Schema of every answer. The id is a text, because JavaScript's numbers are too short for it; it is empty where
/// nothing was sent. Each type is one word: Lichtblick refuses a service that has several of them.
const RESPONSE: &str = r#"{"type":"object","properties":{"accepted":{"type":"boolean"},"request_id":{"type":"string"},"text":{"type":"string"}},"required":["accepted","request_id","text"]}"#;

/// Why a client orders nothing: a page has the lease.
pub(crate) const COMMANDED: &str = "a page commands this robot, and can release it";

/// A call of a service, and its caller.
pub(crate) struct ServiceCall {
    pub call: Call,
    pub service: String,
    pub request: Vec<u8>,
    /// When it came, not later than it truly did by more than the view notices.
    pub issued: MonotonicNs,
    pub from: String,
}

/// Orders of Foxglove clients, and those that wait for the bridge's first report.
#[derive(Default)]
pub(crate) struct Services {
    /// The robots whose services are offered.
    offered: Vec<u32>,
    /// Orders that were given so far.
    given: u64,
    /// Calls without an answer, by their orders, of which each robot has four at most.
    waiting: BTreeMap<String, Call>,
}

/// What a request can hold.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Fields {
    height_m: Option<f64>,
    latitude_deg: Option<f64>,
    longitude_deg: Option<f64>,
    altitude_m: Option<f64>,
    confirm: Option<String>,
}

impl Services {
    /// Offers the services of these robots.
    pub fn offer(&mut self, robots: Vec<u32>, server: &mut Server) {
        if self.offered != robots {
            let services: Vec<OfferedService> =
                robots.iter().flat_map(|robot| of_robot(*robot)).collect();
            server.services(&services);
            self.offered = robots;
        }
    }

    /// Orders what is called for.
    pub fn call(
        &mut self,
        call: ServiceCall,
        (fleet, orders): (&mut Fleet, &mut Orders),
        server: &mut Server,
        config: &RequestConfig,
        now: MonotonicNs,
    ) {
        self.given += 1;
        // No page can choose such a number.
        let number = format!("foxglove.{}", self.given);
        let order = self.read(&call.service, &call.request, number);
        let order =
            order.and_then(
                |order| match may_order(order.kind, server.is_commanded(order.robot)) {
                    true => Ok(order),
                    false => Err(COMMANDED.to_owned()),
                },
            );
        let sent = order.and_then(|order| {
            let shown = fleet.get_mut(order.robot).ok_or("the robot is not shown")?;
            let given = GivenOrder {
                order: &order,
                issued: call.issued,
                from: &call.from,
            };
            Ok(orders.take(&given, shown, config, now))
        });
        match sent {
            Ok(report) => {
                self.waiting.insert(report.order.clone(), call.call);
                server.order(&report);
                if report.is_final {
                    self.answer(&report, None, server);
                }
            }
            Err(why) => {
                tracing::info!(
                    service = call.service,
                    from = call.from,
                    "order not sent: {why}"
                );
                server.respond(call.call, &response(false, None, &why));
            }
        }
    }

    /// The report of an order.
    pub fn report(&mut self, report: &OrderReport, request_id: u64, server: &mut Server) {
        self.answer(report, Some(request_id), server);
    }

    fn answer(&mut self, report: &OrderReport, request_id: Option<u64>, server: &mut Server) {
        if let Some(call) = self.waiting.remove(&report.order) {
            let accepted = matches!(
                report.stage,
                OrderStage::Accepted | OrderStage::InProgress | OrderStage::Done
            );
            server.respond(call, &response(accepted, request_id, &report.text));
        }
    }

    /// The order of a call, or why it is none.
    fn read(&self, service: &str, request: &[u8], order: String) -> Result<OrderRequest, String> {
        let (robot, kind) = (self.offered.iter())
            .find_map(|robot| {
                let services = SERVICES.iter();
                let (_, kind, ..) = services
                    .clone()
                    .find(|(name, ..)| service_name(*robot, name) == service)?;
                Some((*robot, *kind))
            })
            .ok_or("there is no such service")?;
        let request = match request.trim_ascii() {
            b"" => b"{}",
            request => request,
        };
        let fields: Fields = serde_json::from_slice(request)
            .map_err(|error| format!("the request is not what the service takes: {error}"))?;
        let altitude_m = match kind {
            OrderKind::Takeoff => fields.height_m,
            _ => fields.altitude_m,
        };
        Ok(OrderRequest {
            order,
            robot,
            kind,
            seen: 0,
            position: fields
                .latitude_deg
                .zip(fields.longitude_deg)
                .map(Into::into),
            altitude_m,
            confirm: fields.confirm,
        })
    }
}

/// Whether it may be ordered: hold and land always, else while no page commands.
fn may_order(kind: OrderKind, is_commanded: bool) -> bool {
    matches!(kind, OrderKind::Hold | OrderKind::Land) || !is_commanded
}

fn of_robot(robot: u32) -> impl Iterator<Item = OfferedService> {
    SERVICES.iter().map(move |(name, _, properties, required)| OfferedService {
        name: service_name(robot, name),
        kind: format!("ril/{name}"),
        request: format!(
            r#"{{"type":"object","properties":{{{properties}}},"required":[{required}],"additionalProperties":false}}"#
        )
        .into(),
        response: RESPONSE.into(),
    })
}

fn service_name(robot: u32, name: &str) -> String {
    format!("/robot{robot}/{name}")
}

fn response(accepted: bool, request_id: Option<u64>, text: &str) -> Vec<u8> {
    let request_id = request_id.map_or_else(String::new, |id| id.to_string());
    let answer = json!({"accepted": accepted, "request_id": request_id, "text": text});
    answer.to_string().into_bytes()
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;

    fn services() -> Services {
        Services {
            offered: vec![1, 12],
            ..Services::default()
        }
    }

    fn read(service: &str, request: &str) -> Result<OrderRequest, String> {
        services().read(service, request.as_bytes(), "n".to_owned())
    }

    #[test]
    fn schemas_are_json_and_ask_for_what_is_read() {
        for robot in [1, 12] {
            for service in of_robot(robot) {
                for schema in [&service.request, &service.response] {
                    let schema: Value = serde_json::from_str(schema).expect("JSON");
                    let properties = schema["properties"].as_object().unwrap();
                    assert!(
                        properties.values().all(|one| one["type"].is_string()),
                        "{schema}"
                    );
                    let required = schema["required"].as_array().unwrap();
                    assert!(
                        required
                            .iter()
                            .all(|name| schema["properties"][name.as_str().unwrap()].is_object()),
                        "{schema}"
                    );
                }
                assert!(read(&service.name, "{}").is_ok(), "{}", service.name);
            }
        }
    }

    #[test]
    fn a_call_is_the_order_of_a_page() {
        let order = read(
            "/robot12/go_to",
            r#"{"latitude_deg":37.0,"longitude_deg":-6,"altitude_m":20}"#,
        )
        .unwrap();
        assert_eq!((order.robot, order.kind), (12, OrderKind::Goto));
        assert_eq!(
            (order.position, order.altitude_m),
            (Some([37.0, -6.0]), Some(20.0))
        );
        let order = read("/robot1/take_off", r#"{"height_m":10}"#).unwrap();
        assert_eq!(
            (order.robot, order.kind, order.altitude_m),
            (1, OrderKind::Takeoff, Some(10.0))
        );
        assert_eq!(read("/robot1/hold", " ").unwrap().kind, OrderKind::Hold);
        let order = read("/robot1/stop", r#"{"confirm":"stop"}"#).unwrap();
        assert_eq!(order.confirm.as_deref(), Some("stop"));
        for (service, request, why) in [
            ("/robot1/crash", "{}", "there is no such service"),
            ("/robot2/hold", "{}", "there is no such service"),
            ("/robot1/hold", "true", "not what the service takes"),
            (
                "/robot1/take_off",
                r#"{"altitude":10}"#,
                "unknown field `altitude`",
            ),
        ] {
            let error = read(service, request).unwrap_err();
            assert!(error.contains(why), "{error}");
        }
    }

    #[test]
    fn a_page_that_commands_leaves_hold_and_land() {
        let allowed = |kind| [false, true].map(|is_commanded| may_order(kind, is_commanded));
        for kind in [OrderKind::Hold, OrderKind::Land] {
            assert_eq!(allowed(kind), [true, true]);
        }
        for kind in [
            OrderKind::Goto,
            OrderKind::Takeoff,
            OrderKind::Start,
            OrderKind::Stop,
        ] {
            assert_eq!(allowed(kind), [true, false]);
        }
    }
}
