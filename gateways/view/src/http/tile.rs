//! [`FileRequest`]: what the program around the server reads from a disk, or makes. A [`Tile`], a piece of imagery,
//! consists of three numbers, so no text of a request becomes part of a file's name.

/// A tile in the scheme of web maps: at `zoom` the world is a square of 2^zoom tiles each way, from the north-western
/// corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// From 0 to 23.
    pub zoom: u8,
    /// Column, from the west.
    pub x: u32,
    /// Row, from the north.
    pub y: u32,
}

/// What a request wants of a disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// A piece of imagery.
    Tile(Tile),
    /// The [`report`](crate::report) of the recording that is played, an HTML file.
    Report,
    /// The robots as metrics, which are made of what is known of them.
    Metrics,
}

/// A request to be answered with [`Server::file`](crate::Server::file).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileRequest {
    /// What it wants.
    pub wanted: Wanted,
    /// Whether the connection stays after the answer.
    pub(crate) stays: bool,
    /// Whether the answer has a body.
    pub(crate) has_body: bool,
}

impl Tile {
    /// Deepest zoom of the page's map.
    pub const MAX_ZOOM: u8 = 23;

    /// The tile of a path such as `/tiles/18/126690/101200`; `None` if the path names none.
    pub(crate) fn of_path(path: &str) -> Option<Tile> {
        let mut parts = path.strip_prefix("/tiles/")?.split('/');
        let mut number = || {
            let text = parts.next()?;
            let number: u32 = text.parse().ok()?;
            // Each tile has one name: no sign, no leading zero.
            (number.to_string() == text).then_some(number)
        };
        let (zoom, x, y) = (number()?, number()?, number()?);
        let zoom = u8::try_from(zoom)
            .ok()
            .filter(|zoom| *zoom <= Tile::MAX_ZOOM)?;
        let edge = 1_u32 << zoom;
        (parts.next().is_none() && x < edge && y < edge).then_some(Tile { zoom, x, y })
    }
}

/// The content type of an image that browsers draw; `None` if the bytes are none.
pub(crate) fn content_type(image: &[u8]) -> Option<&'static str> {
    match image {
        [0x89, b'P', b'N', b'G', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        riff if riff.starts_with(b"RIFF") && riff.get(8..12) == Some(b"WEBP") => Some("image/webp"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_is_three_numbers_and_nothing_else() {
        let tile = |zoom, x, y| Some(Tile { zoom, x, y });
        for (path, expected) in [
            ("/tiles/0/0/0", tile(0, 0, 0)),
            ("/tiles/18/126690/101200", tile(18, 126_690, 101_200)),
            ("/tiles/23/8388607/8388607", tile(23, 8_388_607, 8_388_607)),
            ("/tiles/24/0/0", None),
            ("/tiles/1/2/0", None),
            ("/tiles/1/0/2", None),
            ("/tiles/1/0", None),
            ("/tiles/1/0/0/0", None),
            ("/tiles/1/0/0.png", None),
            ("/tiles/1/+0/0", None),
            ("/tiles/1/00/0", None),
            ("/tiles/1/-1/0", None),
            ("/tiles/../1/0", None),
            ("/tiles/1/%30/0", None),
            ("/tiles/1//0", None),
            ("/tiles/4294967296/0/0", None),
            ("/app.js", None),
        ] {
            assert_eq!(Tile::of_path(path), expected, "{path}");
        }
    }

    #[test]
    fn an_image_is_known_by_its_first_bytes() {
        for (bytes, expected) in [
            (&b"\x89PNG\r\n\x1a\n"[..], Some("image/png")),
            (b"\xff\xd8\xff\xe0", Some("image/jpeg")),
            (b"RIFF\0\0\0\0WEBPVP8 ", Some("image/webp")),
            (b"<svg onload=alert(1)>", None),
            (b"", None),
        ] {
            assert_eq!(content_type(bytes), expected, "{bytes:?}");
        }
    }
}
