//! [`OutlineReader`]: the geofence in force and the path that the bridge holds, of the pieces of the topic
//! `bridge/outline`.
//!
//! A pure value. A piece that cannot be one is left out, as is a whole that its pieces contradict: what is not known is
//! not drawn.

use std::collections::BTreeMap;

use crate::code::OutlineKind;
use crate::payload::{BridgeOutline, OUTLINE_POINTS, OutlinePoint, WaypointPosition};

/// Most areas of an outline.
pub const MAX_AREAS: usize = 64;

/// Most corners of an area.
pub const MAX_CORNERS: usize = 256;

/// Most waypoints of a path.
pub const MAX_WAYPOINTS: usize = 1024;

/// Most pieces of an outline: one of the fence, those of the areas and of the path. An outline of more is left out.
pub const MAX_PIECES: usize =
    1 + MAX_AREAS * (MAX_CORNERS / OUTLINE_POINTS) + MAX_WAYPOINTS / OUTLINE_POINTS;

/// What the bridge holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// Which outline; [`ModuleState`](crate::payload::ModuleState) repeats the number of the one that holds.
    pub number: u64,
    /// Lowest telemetry altitude everywhere, m.
    pub floor_m: Option<f64>,
    /// Highest telemetry altitude everywhere, m.
    pub ceiling_m: Option<f64>,
    /// The areas of the fence in their order.
    pub areas: Vec<OutlineArea>,
    /// The waypoints of the path under way; empty if there is none.
    pub path: Vec<WaypointPosition>,
}

/// An area of the fence.
#[derive(Clone, Debug, PartialEq)]
pub struct OutlineArea {
    /// What it is called.
    pub name: String,
    /// Whether the helicopter must stay inside.
    pub is_inclusion: bool,
    /// It begins at this telemetry altitude, m.
    pub floor_m: Option<f64>,
    /// It ends at this telemetry altitude, m.
    pub ceiling_m: Option<f64>,
    /// Where it is.
    pub shape: OutlineShape,
}

/// The shape of an area; places are latitude and longitude in degrees.
#[derive(Clone, Debug, PartialEq)]
pub enum OutlineShape {
    /// Corners in order; the last one is joined with the first.
    Polygon(Vec<[f64; 2]>),
    /// A circle.
    Circle {
        /// Its middle.
        centre: [f64; 2],
        /// Its radius, m.
        radius_m: f64,
    },
}

/// Collects the pieces of `bridge/outline` until they are a whole [`Outline`].
#[derive(Clone, Debug, Default)]
pub struct OutlineReader {
    /// Of the outline that is being read: its number and how many pieces it has. At most [`MAX_PIECES`] are kept.
    reading: (u64, u32),
    pieces: BTreeMap<u32, BridgeOutline>,
    whole: Option<Outline>,
}

impl OutlineReader {
    /// Nothing is known.
    pub fn new() -> OutlineReader {
        OutlineReader::default()
    }

    /// Takes a piece, in the order in which they come. Says whether another outline is whole now.
    pub fn take(&mut self, piece: &BridgeOutline) -> bool {
        let is_one = piece.piece < piece.pieces
            && piece.pieces as usize <= MAX_PIECES
            && piece.count as usize <= OUTLINE_POINTS;
        if !is_one {
            return false;
        }
        let is_known = (self.whole.as_ref()).is_some_and(|whole| whole.number == piece.number);
        if is_known {
            self.pieces.clear();
            return false;
        }
        let of = (piece.number, piece.pieces);
        if self.reading != of {
            self.pieces.clear();
            self.reading = of;
        }
        self.pieces.insert(piece.piece, *piece);
        if self.pieces.len() < piece.pieces as usize {
            return false;
        }
        let pieces = std::mem::take(&mut self.pieces);
        match whole(piece.number, pieces.values()) {
            Some(whole) => {
                self.whole = Some(whole);
                true
            }
            None => false,
        }
    }

    /// The last outline that came whole; `None` if none has. It holds as long as the state of the bridge has its
    /// number.
    pub fn outline(&self) -> Option<&Outline> {
        self.whole.as_ref()
    }
}

/// The outline of all its pieces in order; `None` if they contradict each other.
fn whole<'a>(number: u64, pieces: impl Iterator<Item = &'a BridgeOutline>) -> Option<Outline> {
    let mut outline = Outline {
        number,
        ..Outline::default()
    };
    let (mut areas, mut waypoints) = (None, 0);
    // Points of the last area that are still to come.
    let mut open = 0;
    for piece in pieces {
        match piece.kind()? {
            OutlineKind::Fence => {
                (areas, waypoints) = (Some(piece.area as usize), piece.total as usize);
                (outline.floor_m, outline.ceiling_m) = (piece.floor(), piece.ceiling());
            }
            OutlineKind::Area if piece.first == 0 => {
                if open > 0 || piece.area as usize != outline.areas.len() {
                    return None;
                }
                outline.areas.push(area(piece)?);
                open = piece.total.checked_sub(piece.count)?;
            }
            OutlineKind::Area => {
                let OutlineShape::Polygon(corners) = &mut outline.areas.last_mut()?.shape else {
                    return None;
                };
                if piece.first as usize != corners.len() {
                    return None;
                }
                corners.extend(places(piece)?);
                open = open.checked_sub(piece.count)?;
            }
            OutlineKind::Path => {
                if piece.first as usize != outline.path.len() {
                    return None;
                }
                outline.path.extend(piece.points().iter().map(position));
            }
        }
    }
    let is_whole = open == 0
        && areas == Some(outline.areas.len())
        && outline.path.len() == waypoints
        && outline
            .path
            .iter()
            .all(|at| is_place([at.latitude_deg, at.longitude_deg]));
    is_whole.then_some(outline)
}

/// The area that begins with this piece.
fn area(piece: &BridgeOutline) -> Option<OutlineArea> {
    let places = places(piece)?;
    let shape = match (piece.radius_m > 0.0, places.first()) {
        (true, Some(centre)) if piece.total == 1 => OutlineShape::Circle {
            centre: *centre,
            radius_m: piece.radius_m,
        },
        (false, Some(_)) => OutlineShape::Polygon(places),
        _ => return None,
    };
    Some(OutlineArea {
        name: piece.name()?.to_owned(),
        is_inclusion: piece.inclusion != 0,
        floor_m: piece.floor(),
        ceiling_m: piece.ceiling(),
        shape,
    })
}

fn places(piece: &BridgeOutline) -> Option<Vec<[f64; 2]>> {
    let place = |point: &OutlinePoint| {
        let place = [point.latitude_deg, point.longitude_deg];
        is_place(place).then_some(place)
    };
    piece.points().iter().map(place).collect()
}

/// Not-a-number is in no range.
fn is_place([latitude_deg, longitude_deg]: [f64; 2]) -> bool {
    (-90.0..=90.0).contains(&latitude_deg) && (-180.0..=180.0).contains(&longitude_deg)
}

fn position(point: &OutlinePoint) -> WaypointPosition {
    WaypointPosition {
        latitude_deg: point.latitude_deg,
        longitude_deg: point.longitude_deg,
        altitude_m: point.altitude_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A piece of outline `number` with `count` points from `first` of `total`.
    fn piece(
        number: u64,
        at: (u32, u32),
        kind: OutlineKind,
        points: (u32, u32, u32),
    ) -> BridgeOutline {
        let (first, count, total) = points;
        let mut piece = BridgeOutline {
            number,
            piece: at.0,
            pieces: at.1,
            kind: kind.code(),
            first,
            count,
            total,
            ..BridgeOutline::default()
        };
        for (index, point) in piece.points.iter_mut().take(count as usize).enumerate() {
            point.latitude_deg = f64::from(first) + index as f64;
            point.altitude_m = 20.0;
        }
        piece
    }

    /// A fence of an area of 40 corners, and a path of two waypoints.
    fn pieces(number: u64) -> [BridgeOutline; 4] {
        let mut fence = piece(number, (0, 4), OutlineKind::Fence, (0, 0, 2));
        fence.area = 1;
        fence.set_limits(Some(5.0), None);
        let mut begin = piece(number, (1, 4), OutlineKind::Area, (0, 32, 40));
        begin.name = BridgeOutline::name_bytes("field");
        begin.inclusion = 1;
        [
            fence,
            begin,
            piece(number, (2, 4), OutlineKind::Area, (32, 8, 40)),
            piece(number, (3, 4), OutlineKind::Path, (0, 2, 2)),
        ]
    }

    #[test]
    fn the_pieces_in_any_order_are_the_outline_and_a_missing_one_is_waited_for() {
        let [a, b, c, d] = pieces(7);
        let mut reader = OutlineReader::new();
        // One is lost, all come again, and then another outline comes.
        for (index, (piece, is_whole)) in [
            (&a, false),
            (&d, false),
            (&c, false),
            (&a, false),
            (&b, true),
            (&c, false),
        ]
        .into_iter()
        .enumerate()
        {
            assert_eq!(reader.take(piece), is_whole, "{index}");
        }
        let outline = reader.outline().unwrap().clone();
        assert_eq!(
            (outline.number, outline.floor_m, outline.ceiling_m),
            (7, Some(5.0), None)
        );
        assert_eq!(
            (outline.areas.len(), outline.areas[0].name.as_str()),
            (1, "field")
        );
        let OutlineShape::Polygon(corners) = &outline.areas[0].shape else {
            panic!("{outline:?}");
        };
        assert_eq!((corners.len(), corners[39]), (40, [39.0, 0.0]));
        assert_eq!((outline.path.len(), outline.path[1].altitude_m), (2, 20.0));

        let next = pieces(8);
        assert!(!reader.take(&next[0]) && !reader.take(&next[1]) && !reader.take(&next[2]));
        assert_eq!(
            reader.outline(),
            Some(&outline),
            "the one before stays until the next one is whole"
        );
        assert!(reader.take(&next[3]));
        assert_eq!(reader.outline().unwrap().number, 8);
    }

    #[test]
    fn what_contradicts_itself_is_no_outline() {
        type Change = fn(&mut [BridgeOutline; 4]);
        let table: [(&str, Change); 9] = [
            ("an unknown kind", |pieces| pieces[1].kind = 9),
            ("another number of areas", |pieces| pieces[0].area = 2),
            ("another number of waypoints", |pieces| pieces[0].total = 3),
            ("corners that are missing", |pieces| pieces[1].total = 41),
            ("corners that overlap", |pieces| pieces[2].first = 31),
            ("no number", |pieces| {
                pieces[1].points[3].latitude_deg = f64::NAN
            }),
            ("a circle of two points", |pieces| pieces[1].radius_m = 5.0),
            ("a name with a control character", |pieces| {
                pieces[1].name[0] = 7
            }),
            ("a piece that is none", |pieces| pieces[3].count = 33),
        ];
        for (what, change) in table {
            let mut pieces = pieces(1);
            change(&mut pieces);
            let mut reader = OutlineReader::new();
            assert!(!pieces.iter().any(|piece| reader.take(piece)), "{what}");
            assert_eq!(reader.outline(), None, "{what}");
        }
        let mut endless = pieces(1)[0];
        endless.pieces = MAX_PIECES as u32 + 1;
        assert!(!OutlineReader::new().take(&endless));
    }

    #[test]
    fn a_circle_has_its_centre_and_an_empty_fence_is_one_piece() {
        let mut fence = piece(1, (0, 2), OutlineKind::Fence, (0, 0, 0));
        fence.area = 1;
        let mut circle = piece(1, (1, 2), OutlineKind::Area, (0, 1, 1));
        circle.radius_m = 30.0;
        let mut reader = OutlineReader::new();
        assert!(!reader.take(&fence) && reader.take(&circle));
        let shape = &reader.outline().unwrap().areas[0].shape;
        let centre = [0.0, 0.0];
        assert_eq!(
            *shape,
            OutlineShape::Circle {
                centre,
                radius_m: 30.0
            }
        );

        assert!(reader.take(&piece(2, (0, 1), OutlineKind::Fence, (0, 0, 0))));
        assert_eq!(
            reader.outline(),
            Some(&Outline {
                number: 2,
                ..Outline::default()
            })
        );
    }
}
