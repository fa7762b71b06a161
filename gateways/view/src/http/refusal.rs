//! [`Refusal`]: why a request gets nothing, and the fixed answer that says so.

/// Headers of all answers: browsers guess no content type, send no referrer, and let no other page embed this one.
macro_rules! guards {
    () => {
        "X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n"
    };
}

/// Headers of answers with a file: browsers guess no content type, send no referrer, and let no other page embed this
/// one.
pub const GUARDS: &str = guards!();

/// A fixed answer that ends the connection.
macro_rules! refusal {
    ($status:literal, $length:literal, $extra:literal, $text:literal) => {
        concat!(
            "HTTP/1.1 ",
            $status,
            "\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: ",
            $length,
            "\r\nConnection: close\r\nCache-Control: no-store\r\n",
            $extra,
            guards!(),
            "\r\n",
            $text
        )
    };
}

/// What is written to a connection for which there is no room, before it is closed.
pub const BUSY: &[u8] = refusal!(
    "503 Service Unavailable",
    26,
    "Retry-After: 2\r\n",
    "Too many others are here.\n"
)
.as_bytes();

/// What is written to a machine that speaks plain HTTP where TLS is spoken, before its connection is closed.
pub const PLAIN: &[u8] = refusal!(
    "400 Bad Request",
    38,
    "",
    "This address speaks TLS: use https://\n"
)
.as_bytes();

/// Why a request gets nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Refusal {
    /// It means nothing.
    Malformed,
    /// Its Host is no name of this machine.
    ForeignHost,
    /// It is from another page.
    ForeignOrigin,
    /// It is of another user, and without a token.
    NoToken,
    /// There is no such file.
    NotFound,
    /// It is neither GET nor HEAD.
    OtherMethod,
    /// Its head did not come in time.
    TooSlow,
    /// It is of another version of WebSocket.
    OtherVersion,
    /// None of the subprotocols that it offers is spoken here.
    OtherProtocol,
    /// Its head is too large.
    TooLarge,
    /// There are too many viewers.
    Busy,
}

impl Refusal {
    /// All of the answer.
    pub fn bytes(self) -> &'static [u8] {
        let text = match self {
            Refusal::Malformed => refusal!(
                "400 Bad Request",
                37,
                "",
                "This is no request that has meaning.\n"
            ),
            Refusal::OtherProtocol => refusal!(
                "400 Bad Request",
                44,
                "",
                "None of these subprotocols are spoken here.\n"
            ),
            Refusal::NoToken => {
                refusal!("401 Unauthorized", 31, "", "This needs a token: ?token=…\n")
            }
            Refusal::ForeignHost => refusal!(
                "403 Forbidden",
                69,
                "",
                "This server is not called by this name; view.toml can add it: names.\n"
            ),
            Refusal::ForeignOrigin => refusal!(
                "403 Forbidden",
                69,
                "",
                "Other pages may not use this server; view.toml can add one: origins.\n"
            ),
            Refusal::NotFound => refusal!("404 Not Found", 23, "", "There is no such file.\n"),
            Refusal::OtherMethod => refusal!(
                "405 Method Not Allowed",
                28,
                "Allow: GET, HEAD\r\n",
                "There is only GET and HEAD.\n"
            ),
            Refusal::TooSlow => refusal!(
                "408 Request Timeout",
                34,
                "",
                "The request did not come in time.\n"
            ),
            Refusal::OtherVersion => refusal!(
                "426 Upgrade Required",
                35,
                "Sec-WebSocket-Version: 13\r\n",
                "WebSocket of version 13 is spoken.\n"
            ),
            Refusal::TooLarge => refusal!(
                "431 Request Header Fields Too Large",
                36,
                "",
                "The head of the request is too big.\n"
            ),
            Refusal::Busy => return BUSY,
        };
        text.as_bytes()
    }

    /// For the log.
    pub fn why(self) -> &'static str {
        match self {
            Refusal::Malformed => "a request without meaning",
            Refusal::ForeignHost => "a request to a name that is not this machine's",
            Refusal::ForeignOrigin => "a request of another page",
            Refusal::NoToken => "no token, and another user or another machine",
            Refusal::NotFound => "a file that does not exist",
            Refusal::OtherMethod => "a request that is neither GET nor HEAD",
            Refusal::TooSlow => "a request that did not come in time",
            Refusal::OtherVersion => "another version of WebSocket",
            Refusal::OtherProtocol => "no WebSocket subprotocol that is spoken here",
            Refusal::TooLarge => "a request whose head is too large",
            Refusal::Busy => "too many viewers",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_whole_answers() {
        let refusals = [
            Refusal::Malformed,
            Refusal::ForeignHost,
            Refusal::ForeignOrigin,
            Refusal::NoToken,
            Refusal::NotFound,
            Refusal::OtherMethod,
            Refusal::TooSlow,
            Refusal::OtherVersion,
            Refusal::OtherProtocol,
            Refusal::TooLarge,
            Refusal::Busy,
        ];
        for bytes in refusals.map(Refusal::bytes).into_iter().chain([PLAIN]) {
            let text = std::str::from_utf8(bytes).unwrap();
            let (head, body) = text.split_once("\r\n\r\n").unwrap();
            assert!(
                head.contains(&format!("\r\nContent-Length: {}\r\n", body.len())),
                "{text}: {} bytes",
                body.len()
            );
            assert!(
                head.contains("\r\nConnection: close\r\n") && head.contains("nosniff"),
                "{head}"
            );
        }
    }
}
