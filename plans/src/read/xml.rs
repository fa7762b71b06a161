//! Looks through an XML file before its reader does: mistakes get their line, and depth and number of elements are bounded.

use quick_xml::Reader;
use quick_xml::events::Event;

use super::items::clean_reason;
use crate::error::ReadError;
use crate::limits::{MAX_ELEMENT_DEPTH, MAX_ELEMENTS};

pub fn check(text: &str) -> Result<(), ReadError> {
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
            return Err(ReadError::TooDeep(line(reader.buffer_position())));
        }
        if elements > MAX_ELEMENTS {
            return Err(ReadError::TooManyElements);
        }
    }
}
