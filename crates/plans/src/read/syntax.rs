//! The syntax of files: JSON is parsed; XML is looked through before its reader does, so that mistakes get their line,
//! and depth and number of elements are bounded.

use quick_xml::Reader;
use quick_xml::events::Event;
use serde::de::DeserializeOwned;

use super::items::clean_reason;
use crate::error::{MAX_ELEMENT_DEPTH, MAX_ELEMENTS, ReadError};

/// Parses JSON; a mistake is reported with its line.
pub(super) fn json<T: DeserializeOwned>(text: &str) -> Result<T, ReadError> {
    serde_json::from_str(text).map_err(|error| {
        if error.is_eof() {
            let reason = match text.trim().is_empty() {
                true => "the file is empty",
                false => "the file ends in the middle of a list or object: it is cut off",
            };
            return ReadError::line(error.line().max(1), reason);
        }
        // The message ends with the place, which the error has by itself.
        let message = error.to_string();
        let reason = clean_reason(message.split(" at line ").next().unwrap_or_default());
        match error.line() {
            0 => ReadError::file(reason),
            line => ReadError::line(line, reason),
        }
    })
}

/// Looks through an XML file.
pub(super) fn check_xml(text: &str) -> Result<(), ReadError> {
    let mut reader = Reader::from_str(text);
    let (mut depth, mut elements) = (0_usize, 0_usize);
    loop {
        let event = reader.read_event();
        let line = |position: u64| {
            let before = &text.as_bytes()[..(position as usize).min(text.len())];
            before.iter().filter(|byte| **byte == b'\n').count() + 1
        };
        match event {
            Ok(Event::Start(_)) => {
                depth += 1;
                elements += 1;
            }
            Ok(Event::Empty(_)) => elements += 1,
            Ok(Event::End(_)) => depth = depth.saturating_sub(1),
            Ok(Event::DocType(_)) => {
                let line = line(reader.buffer_position());
                return Err(ReadError::line(line, "a document type is not read"));
            }
            Ok(Event::Eof) if depth > 0 => {
                return Err(ReadError::file("not valid XML: it ends within an element"));
            }
            Ok(Event::Eof) if elements == 0 => {
                return Err(ReadError::file("not valid XML: there is no element"));
            }
            Ok(Event::Eof) => return Ok(()),
            Ok(_) => {}
            Err(error) => {
                let line = line(reader.error_position());
                return Err(ReadError::line(
                    line,
                    clean_reason(&format!("not valid XML: {error}")),
                ));
            }
        }
        if depth > MAX_ELEMENT_DEPTH {
            let line = line(reader.buffer_position());
            let reason =
                format!("XML elements lie more than {MAX_ELEMENT_DEPTH} deep in each other");
            return Err(ReadError::line(line, reason));
        }
        if elements > MAX_ELEMENTS {
            let reason = format!("more than {MAX_ELEMENTS} XML elements");
            return Err(ReadError::new(reason));
        }
    }
}
