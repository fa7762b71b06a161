//! Connections that never become sessions: false ones, those with expired certificates, and those that fall silent. A
//! station whose certificate is good gets in among them.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use relay::certify::{CertifyArgs, certify};
use ril_tests::process::WAIT_LIMIT;
use time::{Duration, OffsetDateTime};

use crate::hostile::Stranger;
use crate::rig::Rig;
use crate::secured_rig;

/// False connections that are open at any moment. Zenoh's own pause after a failed handshake, 100 ms, makes 20 s of
/// them: a station, which waits 8 s, would never get in.
const FALSE_AT_ONCE: usize = 200;

/// Stations with expired certificates.
const EXPIRED: usize = 12;

/// Connections that fall silent.
const SILENT: usize = 300;

/// Where a socket connects to.
fn address(endpoint: &str) -> &str {
    endpoint.split_once('/').expect("protocol/address").1
}

fn connect(address: &str) -> TcpStream {
    let connection = TcpStream::connect(address).expect("the relay listens");
    let limited = connection.set_read_timeout(Some(WAIT_LIMIT));
    limited.expect("a limit of time");
    connection
}

/// Waits until the other side has closed the connection.
fn until_closed(mut connection: TcpStream) {
    let mut bytes = [0; 64];
    // A reset closes it, too.
    while let Ok(count) = connection.read(&mut bytes)
        && count > 0
    {}
}

/// Keeps up so many connections that are no TLS, until `is_over`: when the relay closes one, another one takes its
/// place. Says how many the relay has closed.
fn false_connections(address: &str, is_over: &AtomicBool) -> usize {
    let open = || {
        let mut connection = connect(address);
        // The relay may have closed it already.
        let _ = connection.write_all(b"GET / HTTP/1.1\r\n\r\n");
        connection
    };
    let mut connections: VecDeque<_> = (0..FALSE_AT_ONCE).map(|_| open()).collect();
    let mut closed = 0;
    while !is_over.load(Ordering::Relaxed) {
        if let Some(oldest) = connections.pop_front() {
            until_closed(oldest);
        }
        connections.push_back(open());
        closed += 1;
    }
    closed
}

/// Certificates of stations in `folder`, which have ended nine days ago.
fn expired_certificates(folder: &Path) -> Vec<String> {
    let names: Vec<_> = (0..EXPIRED).map(|number| format!("old-{number}")).collect();
    let machines = names.iter().map(|name| name.parse().expect("a name"));
    let args = CertifyArgs {
        folder: folder.join("pki"),
        machines: machines.collect(),
        days: 1,
        authority_days: 1,
    };
    let then = OffsetDateTime::now_utc() - Duration::days(10);
    certify(&args, then).expect("certificates");
    names
}

/// A station that begins anew gets in, and telemetry and requests go through.
fn a_good_station_gets_in(rig: &mut Rig) {
    rig.restart_station();
    rig.until_telemetry_comes(5);
    rig.request_done();
}

#[test]
fn hundreds_of_false_tls_connections_at_any_moment_keep_no_good_station_out() {
    let (mut rig, endpoint) = secured_rig("tls", false);
    let is_over = Arc::new(AtomicBool::new(false));
    let flood = {
        let (is_over, endpoint) = (Arc::clone(&is_over), endpoint.clone());
        thread::spawn(move || false_connections(address(&endpoint), &is_over))
    };
    a_good_station_gets_in(&mut rig);
    is_over.store(true, Ordering::Relaxed);
    let closed = flood.join().expect("the flood");
    println!("{closed} false connections were closed");
    rig.end();
}

fn stations_with_expired_certificates_keep_no_good_one_out(protocol: &str) {
    let (mut rig, endpoint) = secured_rig(protocol, false);
    let folder = rig.folder.path().to_owned();
    let stations = expired_certificates(&folder).into_iter();
    let stations = stations.map(|name| Stranger::persistent(&endpoint, &folder, &name));
    let stations: Vec<_> = stations
        .map(|station| (station.listen("**"), station))
        .collect();
    a_good_station_gets_in(&mut rig);
    for (heard, _) in &stations {
        assert_eq!(heard.drain(), [], "its certificate has ended");
    }
    rig.end();
}

#[test]
fn twelve_stations_with_expired_certificates_keep_no_good_one_out_over_tls() {
    stations_with_expired_certificates_keep_no_good_one_out("tls");
}

#[test]
fn twelve_stations_with_expired_certificates_keep_no_good_one_out_over_quic() {
    stations_with_expired_certificates_keep_no_good_one_out("quic");
}

#[test]
fn connections_that_fall_silent_within_tls_keep_no_good_station_out_and_are_closed() {
    let (mut rig, endpoint) = secured_rig("tls", false);
    let silent = (0..SILENT).map(|_| connect(address(&endpoint)));
    let silent: Vec<_> = silent.collect();
    a_good_station_gets_in(&mut rig);
    silent.into_iter().for_each(until_closed);
    rig.end();
}
