//! Bytes that go over the connections of a TCP port, as the kernel counts them and `ss` shows them.

use std::net::TcpListener;
use std::process::Command;

use anyhow::Result;

/// Sums over the connections of a port, since each began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes of data that went out.
    pub sent: u64,
    /// Bytes of data that came in.
    pub received: u64,
    /// Segments that went out; each has headers besides.
    pub segments_sent: u64,
    /// Segments that came in.
    pub segments_received: u64,
}

impl Traffic {
    /// That of the process that listens at `port`. Nothing when `ss` is not there.
    pub fn of_port(port: u16) -> Result<Option<Traffic>> {
        let shown = Command::new("ss")
            .args(["-tinHO", "state", "established"])
            .arg(format!("sport = :{port}"))
            .output();
        Ok(match shown {
            Ok(output) if output.status.success() => {
                Some(parse(&String::from_utf8_lossy(&output.stdout)))
            }
            _ => None,
        })
    }

    /// What went since `earlier`, when no connection has begun or ended meanwhile.
    pub fn since(self, earlier: Traffic) -> Traffic {
        Traffic {
            sent: self.sent.saturating_sub(earlier.sent),
            received: self.received.saturating_sub(earlier.received),
            segments_sent: self.segments_sent.saturating_sub(earlier.segments_sent),
            segments_received: self
                .segments_received
                .saturating_sub(earlier.segments_received),
        }
    }
}

/// Adds up the lines of `ss -i`.
fn parse(lines: &str) -> Traffic {
    let mut traffic = Traffic::default();
    for word in lines.split_whitespace() {
        let Some((key, value)) = word.split_once(':') else {
            continue;
        };
        let value = value.parse().unwrap_or(0);
        match key {
            "bytes_sent" => traffic.sent += value,
            "bytes_received" => traffic.received += value,
            "segs_out" => traffic.segments_sent += value,
            "segs_in" => traffic.segments_received += value,
            _ => {}
        }
    }
    traffic
}

/// A port of the loopback interface that nothing listens at.
pub fn free_port() -> Result<u16> {
    Ok(TcpListener::bind("127.0.0.1:0")?.local_addr()?.port())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_of_a_port_add_up() {
        let lines = "\
0 0 127.0.0.1:7447 127.0.0.1:50000 cubic wscale:7,7 rto:204 bytes_sent:100 bytes_acked:101 bytes_received:7 segs_out:3 segs_in:2 send 5Mbps
0 0 127.0.0.1:7447 127.0.0.1:50001 cubic bytes_sent:10 bytes_received:1 segs_out:1 segs_in:1
";
        let expected = Traffic {
            sent: 110,
            received: 8,
            segments_sent: 4,
            segments_received: 3,
        };
        assert_eq!(parse(lines), expected);
        assert_eq!(parse(""), Traffic::default());
        let earlier = Traffic {
            sent: 100,
            ..Traffic::default()
        };
        assert_eq!(expected.since(earlier).sent, 10);
    }
}
