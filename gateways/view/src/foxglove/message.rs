//! The messages of Foxglove's protocol: JSON with `op`, and binary ones that begin with an opcode. Numbers are
//! little-endian.

use serde::{Deserialize, Serialize};

use super::playback::{self, ControlRequest, Moment};

/// Opcodes of binary messages to clients.
const MESSAGE_DATA: u8 = 1;
const TIME: u8 = 2;
const FETCH_ASSET_RESPONSE: u8 = 4;

/// Opcodes of binary messages from clients.
const CLIENT_MESSAGE_DATA: u8 = 1;
const SERVICE_CALL_REQUEST: u8 = 2;
const PLAYBACK_CONTROL_REQUEST: u8 = 3;

/// A JSON message to a client.
#[derive(Debug, Serialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(crate) enum Outgoing<'a> {
    ServerInfo {
        name: &'a str,
        capabilities: &'a [&'a str],
        session_id: &'a str,
        /// Beginning and end of a recording.
        #[serde(skip_serializing_if = "Option::is_none")]
        data_start_time: Option<Moment>,
        #[serde(skip_serializing_if = "Option::is_none")]
        data_end_time: Option<Moment>,
    },
    Status {
        /// 0 for information, 1 for a warning, 2 for an error.
        level: u8,
        message: &'a str,
        id: &'a str,
    },
    Advertise {
        channels: Vec<ChannelInfo<'a>>,
    },
    Unadvertise {
        channel_ids: Vec<u32>,
    },
    ServiceCallFailure {
        service_id: u32,
        call_id: u32,
        message: &'a str,
    },
}

/// A channel as clients get it.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ChannelInfo<'a> {
    pub id: u32,
    pub topic: &'a str,
    pub encoding: &'a str,
    pub schema_name: &'a str,
    pub schema: &'a str,
    pub schema_encoding: &'a str,
}

/// A JSON message from a client.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(crate) enum Incoming {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    /// A client that wants to publish.
    Advertise,
    /// A client that wants to set parameters.
    SetParameters,
    FetchAsset {
        uri: String,
        request_id: u32,
    },
    /// What is not offered here.
    #[serde(other)]
    Other,
}

/// What a client wants of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Subscription {
    pub id: u32,
    pub channel_id: u32,
}

/// A binary message from a client.
#[derive(Debug, PartialEq)]
pub(crate) enum Binary<'a> {
    /// A call of a service, of which there are none.
    ServiceCall { service: u32, call: u32 },
    /// What is wanted of a recording.
    Playback(ControlRequest<'a>),
    /// A client that publishes.
    Publish,
}

impl Outgoing<'_> {
    /// The message as JSON.
    pub fn text(&self) -> String {
        // Serde fails for maps whose keys are no texts; these messages have none.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// Reads a binary message; `None` if it means nothing.
pub(crate) fn read_binary(bytes: &[u8]) -> Option<Binary<'_>> {
    let (opcode, rest) = bytes.split_first()?;
    match *opcode {
        CLIENT_MESSAGE_DATA => Some(Binary::Publish),
        PLAYBACK_CONTROL_REQUEST => playback::read(rest).map(Binary::Playback),
        SERVICE_CALL_REQUEST => {
            let (service, rest) = number(rest)?;
            let (call, rest) = number(rest)?;
            let (length, rest) = number(rest)?;
            rest.get(..usize::try_from(length).ok()?)?;
            Some(Binary::ServiceCall { service, call })
        }
        _ => None,
    }
}

fn number(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let (number, rest) = bytes.split_first_chunk()?;
    Some((u32::from_le_bytes(*number), rest))
}

/// A sample for a subscription.
pub(crate) fn message_data(subscription: u32, log_time_unix_ns: u64, sample: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(13 + sample.len());
    bytes.push(MESSAGE_DATA);
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(log_time_unix_ns.to_le_bytes());
    bytes.extend(sample);
    bytes
}

/// The server's time.
pub(crate) fn time(unix_ns: u64) -> Vec<u8> {
    let mut bytes = vec![TIME];
    bytes.extend(unix_ns.to_le_bytes());
    bytes
}

/// A file, or why there is none.
pub(crate) fn asset_response(request: u32, asset: Result<&[u8], &str>) -> Vec<u8> {
    let (status, error, file) = match asset {
        Ok(file) => (0, "", file),
        Err(error) => (1, error, &[][..]),
    };
    let mut bytes = vec![FETCH_ASSET_RESPONSE];
    bytes.extend(request.to_le_bytes());
    bytes.push(status);
    bytes.extend((error.len() as u32).to_le_bytes());
    bytes.extend(error.as_bytes());
    bytes.extend(file);
    bytes
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    #[test]
    fn messages_to_clients_are_those_of_the_specification() {
        for (message, expected) in [
            (
                Outgoing::ServerInfo {
                    name: "n",
                    capabilities: &["time"],
                    session_id: "s",
                    data_start_time: None,
                    data_end_time: None,
                },
                json!({"op": "serverInfo", "name": "n", "capabilities": ["time"], "sessionId": "s"}),
            ),
            (
                Outgoing::Status {
                    level: 1,
                    message: "m",
                    id: "i",
                },
                json!({"op": "status", "level": 1, "message": "m", "id": "i"}),
            ),
            (
                Outgoing::Advertise {
                    channels: vec![ChannelInfo {
                        id: 1,
                        topic: "/a",
                        encoding: "cdr",
                        schema_name: "p/msg/T",
                        schema: "uint8 x",
                        schema_encoding: "ros2msg",
                    }],
                },
                json!({"op": "advertise", "channels": [{"id": 1, "topic": "/a", "encoding": "cdr", "schemaName": "p/msg/T", "schema": "uint8 x", "schemaEncoding": "ros2msg"}]}),
            ),
            (
                Outgoing::Unadvertise {
                    channel_ids: vec![1, 2],
                },
                json!({"op": "unadvertise", "channelIds": [1, 2]}),
            ),
            (
                Outgoing::ServiceCallFailure {
                    service_id: 3,
                    call_id: 4,
                    message: "m",
                },
                json!({"op": "serviceCallFailure", "serviceId": 3, "callId": 4, "message": "m"}),
            ),
        ] {
            assert_eq!(
                serde_json::from_str::<Value>(&message.text()).unwrap(),
                expected
            );
        }
        assert_eq!(
            message_data(0x0102, 3, b"ab"),
            b"\x01\x02\x01\0\0\x03\0\0\0\0\0\0\0ab"
        );
        assert_eq!(time(258), b"\x02\x02\x01\0\0\0\0\0\0");
    }

    #[test]
    fn messages_from_clients_are_read() {
        let read = |text: &str| serde_json::from_str::<Incoming>(text).ok();
        for (text, expected) in [
            (
                r#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":3}]}"#,
                Some(Incoming::Subscribe {
                    subscriptions: vec![Subscription {
                        id: 0,
                        channel_id: 3,
                    }],
                }),
            ),
            (
                r#"{"op":"unsubscribe","subscriptionIds":[0,1]}"#,
                Some(Incoming::Unsubscribe {
                    subscription_ids: vec![0, 1],
                }),
            ),
            (
                r#"{"op":"advertise","channels":[{"id":1}]}"#,
                Some(Incoming::Advertise),
            ),
            (
                r#"{"op":"setParameters","parameters":[{"name":"/p","value":3}]}"#,
                Some(Incoming::SetParameters),
            ),
            (
                r#"{"op":"subscribeConnectionGraph"}"#,
                Some(Incoming::Other),
            ),
            (r#"{"op":"subscribe"}"#, None),
            (
                r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":3}]}"#,
                None,
            ),
            (
                r#"{"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":3}]}"#,
                None,
            ),
            ("{}", None),
            ("[]", None),
            ("", None),
        ] {
            assert_eq!(read(text), expected, "{text}");
        }
    }

    #[test]
    fn binary_messages_are_read_or_mean_nothing() {
        let call = b"\x02\x01\0\0\0\x02\0\0\0\x04\0\0\0json{}";
        let expected = Binary::ServiceCall {
            service: 1,
            call: 2,
        };
        assert_eq!(read_binary(call), Some(expected));
        for length in 0..17 {
            assert_eq!(read_binary(&call[..length]), None, "{length}");
        }
        assert_eq!(
            read_binary(b"\x02\x01\0\0\0\x02\0\0\0\xff\xff\xff\xffjson"),
            None
        );
        assert_eq!(read_binary(b"\x01anything"), Some(Binary::Publish));
        assert_eq!(read_binary(b"\x07"), None);
    }
}
