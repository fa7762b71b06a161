//! HTTP/1.1 as far as a page and a WebSocket need it: bytes in, one request or one refusal out, and fixed answers.

pub(crate) mod answer;
pub(crate) mod refusal;
pub(crate) mod request;
pub(crate) mod tile;
