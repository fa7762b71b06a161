//! Until when a certificate holds: the one field of it that is looked at before a flight.

use std::fs;
use std::path::Path;

use data_encoding::BASE64;
use status::log::clock::Utc;

const BEGIN: &str = "-----BEGIN CERTIFICATE-----";
const END: &str = "-----END CERTIFICATE-----";

/// Tags of DER.
const SEQUENCE: u8 = 0x30;
const VERSION: u8 = 0xa0;
const UTC_TIME: u8 = 0x17;
const GENERALIZED_TIME: u8 = 0x18;

/// When the first certificate of a PEM file ends, Unix time in s.
///
/// # Errors
///
/// Why that cannot be known, in words.
pub fn end_unix_s(file: &Path) -> Result<u64, String> {
    let text = fs::read_to_string(file).map_err(|error| error.to_string())?;
    let der = first(&text).ok_or("it has no certificate in PEM")?;
    end(&der).ok_or_else(|| "its certificate cannot be read".to_owned())
}

/// The bytes of the first certificate.
fn first(text: &str) -> Option<Vec<u8>> {
    let (_, rest) = text.split_once(BEGIN)?;
    let (body, _) = rest.split_once(END)?;
    let body: String = body.split_ascii_whitespace().collect();
    BASE64.decode(body.as_bytes()).ok()
}

/// `notAfter` of RFC 5280: Certificate { tbs { [version], serial, algorithm, issuer, validity { notBefore, notAfter } …
/// } … }.
fn end(der: &[u8]) -> Option<u64> {
    let (certificate, _) = of(SEQUENCE, der)?;
    let (mut rest, _) = of(SEQUENCE, certificate)?;
    if rest.first() == Some(&VERSION) {
        rest = skip(rest)?;
    }
    for _ in ["serial", "algorithm", "issuer"] {
        rest = skip(rest)?;
    }
    let (validity, _) = of(SEQUENCE, rest)?;
    let (tag, text, _) = value(skip(validity)?)?;
    moment(tag, std::str::from_utf8(text).ok()?)
}

/// The tag, the content and what follows.
fn value(der: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (&tag, rest) = der.split_first()?;
    let (&short, mut rest) = rest.split_first()?;
    let mut length = usize::from(short);
    if short & 0x80 != 0 {
        let count = usize::from(short & 0x7f);
        if !(1..=4).contains(&count) {
            return None;
        }
        let bytes = rest.get(..count)?;
        length = bytes
            .iter()
            .fold(0, |sum, byte| sum << 8 | usize::from(*byte));
        rest = &rest[count..];
    }
    Some((tag, rest.get(..length)?, rest.get(length..)?))
}

fn of(expected: u8, der: &[u8]) -> Option<(&[u8], &[u8])> {
    let (tag, content, rest) = value(der)?;
    (tag == expected).then_some((content, rest))
}

fn skip(der: &[u8]) -> Option<&[u8]> {
    value(der).map(|(_, _, rest)| rest)
}

/// `YYMMDDHHMMSSZ`, where YY from 50 is of the last century, or `YYYYMMDDHHMMSSZ`.
fn moment(tag: u8, text: &str) -> Option<u64> {
    let digits = text.strip_suffix('Z')?;
    let full = match tag {
        UTC_TIME if digits < "50" => format!("20{digits}"),
        UTC_TIME => format!("19{digits}"),
        GENERALIZED_TIME => digits.to_owned(),
        _ => return None,
    };
    if full.len() != 14 || !full.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let part = |from: usize| full[from..from + 2].parse::<u64>().ok();
    let utc = Utc {
        year: full[..4].parse().ok()?,
        month: part(4)?,
        day: part(6)?,
        hour: part(8)?,
        minute: part(10)?,
        second: part(12)?,
    };
    utc.unix_s()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Made by `openssl req -x509`, of which `openssl x509 -enddate` says [`ENDS`].
    const PEM: &str = include_str!("certificate.pem");
    const ENDS: u64 = 4_949_291_563;

    #[test]
    fn the_end_of_a_certificate_is_found() {
        let der = first(PEM).unwrap();
        assert_eq!(end(&der), Some(ENDS));
        for length in 0..200 {
            assert_eq!(end(&der[..length]), None, "{length}");
        }
        for (text, expected) in [
            ("", None),
            (BEGIN, None),
            (
                "-----BEGIN CERTIFICATE-----\n!\n-----END CERTIFICATE-----",
                None,
            ),
        ] {
            assert_eq!(first(text), expected, "{text}");
        }
    }

    #[test]
    fn both_ways_to_write_a_time_are_read() {
        for (tag, text, expected) in [
            (UTC_TIME, "700101000000Z", Some(0)),
            (UTC_TIME, "261126120000Z", Some(1_795_694_400)),
            (UTC_TIME, "491231235959Z", Some(2_524_607_999)),
            (UTC_TIME, "500101000000Z", None),
            (GENERALIZED_TIME, "20500101000000Z", Some(2_524_608_000)),
            (GENERALIZED_TIME, "20000229010203Z", Some(951_786_123)),
            (GENERALIZED_TIME, "99991231235959Z", Some(253_402_300_799)),
            (UTC_TIME, "2611261200Z", None),
            (UTC_TIME, "261126120000+0100", None),
            (0x0c, "261126120000Z", None),
        ] {
            assert_eq!(moment(tag, text), expected, "{text}");
        }
    }
}
