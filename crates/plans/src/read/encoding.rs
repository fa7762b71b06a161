//! Bytes become text: UTF-8, or what a byte order mark or an XML declaration says.

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};

use super::items::clean;
use crate::error::ReadError;

/// The text of a file, without a byte order mark.
pub fn decode(bytes: &[u8]) -> Result<String, ReadError> {
    let (encoding, bytes) = match Encoding::for_bom(bytes) {
        Some((encoding, length)) => (encoding, &bytes[length..]),
        None => (declared(bytes)?, bytes),
    };
    let text = encoding.decode_without_bom_handling_and_without_replacement(bytes);
    // Every system's ends of lines are one `\n`, so that lines are counted as an editor counts them.
    let text = text.map(|text| text.replace("\r\n", "\n").replace('\r', "\n"));
    text.ok_or_else(|| {
        let valid = match encoding == UTF_8 {
            true => std::str::from_utf8(bytes).map_or_else(|error| error.valid_up_to(), str::len),
            false => 0,
        };
        let line = bytes[..valid].iter().filter(|byte| **byte == b'\n').count() + 1;
        let name = encoding.name();
        ReadError::line(line, format!("the bytes are not {name} text"))
    })
}

/// The encoding of an XML declaration. Bytes in which it can be read are not UTF-16, whatever it says.
fn declared(bytes: &[u8]) -> Result<&'static Encoding, ReadError> {
    match bytes {
        [b'<', 0, ..] => return Ok(UTF_16LE),
        [0, b'<', ..] => return Ok(UTF_16BE),
        _ => {}
    }
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(256)]);
    let declaration = head
        .strip_prefix("<?xml")
        .and_then(|rest| rest.split_once("?>"));
    let label = declaration.and_then(|(declaration, _)| {
        let value = declaration
            .split_once("encoding")?
            .1
            .trim_start()
            .strip_prefix('=')?
            .trim_start();
        let mut quoted = value.chars();
        let quote = quoted.next()?;
        quoted.as_str().split_once(quote).map(|(label, _)| label)
    });
    let Some(label) = label else {
        return Ok(UTF_8);
    };
    match Encoding::for_label(label.as_bytes()) {
        Some(encoding) => Ok(encoding.output_encoding()),
        None => Err(ReadError::line(
            1,
            format!("the encoding `{}` is not known", clean(label)),
        )),
    }
}
