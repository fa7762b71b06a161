//! [`Outline`]: what the bridge publishes of the geofence in force and of the path that it holds, piece by piece.
//!
//! It is pure. The number of an outline is the core's: it is in its state, so a journal has it. The pieces follow from
//! what the core holds. When they are sent: [`Rounds`](module_kit::pieces::Rounds).

use dsp_protocol::Waypoint;
use ipc_types::code::OutlineKind;
use ipc_types::payload::{BridgeOutline, OUTLINE_POINTS, OutlinePoint};

use crate::safety::fence::{AreaConfig, AreaKind, Fence};

/// What the bridge holds.
#[derive(Clone, Copy, Debug)]
pub struct Outline<'a> {
    /// Changes with every change of fence or path, also after a restart.
    pub number: u64,
    /// The geofence in force.
    pub fence: &'a Fence,
    /// The waypoints of the path under way; empty if there is none.
    pub path: &'a [Waypoint],
}

impl Outline<'_> {
    /// How many pieces it has.
    pub fn pieces(&self) -> usize {
        1 + self.areas().map(parts_of).sum::<usize>() + self.path.len().div_ceil(OUTLINE_POINTS)
    }

    /// The piece `index`, counted from 0, without what its publisher writes; `None` if there is no such piece.
    pub fn piece(&self, index: usize) -> Option<BridgeOutline> {
        let pieces = self.pieces();
        let head = BridgeOutline {
            number: self.number,
            piece: index as u32,
            pieces: pieces as u32,
            ..BridgeOutline::default()
        };
        let Some(mut part) = index.checked_sub(1) else {
            return Some(self.fence_as_a_whole(head));
        };
        for (place, area) in self.areas().enumerate() {
            match part.checked_sub(parts_of(area)) {
                Some(behind) => part = behind,
                None => return Some(of_area(head, place, area, part)),
            }
        }
        let waypoints = self.path.chunks(OUTLINE_POINTS).nth(part)?;
        Some(of_path(head, self.path.len(), part, waypoints))
    }

    fn areas(&self) -> impl Iterator<Item = &AreaConfig> {
        self.fence.area_configs()
    }

    fn fence_as_a_whole(&self, head: BridgeOutline) -> BridgeOutline {
        let (floor_m, ceiling_m) = self.fence.limits();
        let mut piece = BridgeOutline {
            kind: OutlineKind::Fence.code(),
            area: self.fence.areas() as u32,
            total: self.path.len() as u32,
            ..head
        };
        piece.set_limits(floor_m, ceiling_m);
        piece
    }
}

/// The points of an area: its corners without the repetition of the first, or its centre.
fn points_of(area: &AreaConfig) -> &[[f64; 2]] {
    match (&area.polygon, &area.centre) {
        (Some(corners), _) => match corners.as_slice() {
            [first, between @ .., last] if first == last && !between.is_empty() => {
                &corners[..corners.len() - 1]
            }
            corners => corners,
        },
        (None, Some(centre)) => std::slice::from_ref(centre),
        (None, None) => &[],
    }
}

/// Into how many pieces an area goes.
fn parts_of(area: &AreaConfig) -> usize {
    points_of(area).len().div_ceil(OUTLINE_POINTS)
}

fn of_area(head: BridgeOutline, place: usize, area: &AreaConfig, part: usize) -> BridgeOutline {
    let points = points_of(area);
    let first = part * OUTLINE_POINTS;
    let here = points.chunks(OUTLINE_POINTS).nth(part).unwrap_or_default();
    let mut piece = BridgeOutline {
        kind: OutlineKind::Area.code(),
        area: place as u32,
        first: first as u32,
        count: here.len() as u32,
        total: points.len() as u32,
        inclusion: u32::from(area.kind == AreaKind::Inclusion),
        radius_m: area.radius_m.unwrap_or_default(),
        name: BridgeOutline::name_bytes(&area.name),
        ..head
    };
    piece.set_limits(area.floor_m, area.ceiling_m);
    for (point, [latitude_deg, longitude_deg]) in piece.points.iter_mut().zip(here) {
        *point = OutlinePoint {
            latitude_deg: *latitude_deg,
            longitude_deg: *longitude_deg,
            altitude_m: 0.0,
        };
    }
    piece
}

fn of_path(
    head: BridgeOutline,
    total: usize,
    part: usize,
    waypoints: &[Waypoint],
) -> BridgeOutline {
    let mut piece = BridgeOutline {
        kind: OutlineKind::Path.code(),
        first: (part * OUTLINE_POINTS) as u32,
        count: waypoints.len() as u32,
        total: total as u32,
        ..head
    };
    for (point, waypoint) in piece.points.iter_mut().zip(waypoints) {
        *point = OutlinePoint {
            latitude_deg: waypoint.latitude_deg,
            longitude_deg: waypoint.longitude_deg,
            altitude_m: waypoint.altitude_m,
        };
    }
    piece
}

#[cfg(test)]
mod tests {
    use ipc_types::outline::{
        MAX_AREAS, MAX_CORNERS, MAX_PIECES, MAX_WAYPOINTS, OutlineReader, OutlineShape,
    };

    use super::*;
    use crate::flight::assembly;
    use crate::safety::fence;

    fn waypoint(index: usize) -> Waypoint {
        Waypoint {
            latitude_deg: index as f64 * 0.001,
            longitude_deg: 2.0,
            altitude_m: 20.5,
        }
    }

    fn fence(text: &str) -> Fence {
        runtime::config::parse(text, "a test").unwrap()
    }

    /// A polygon of `corners` corners round a point, as bridge.toml has it; the last one repeats the first.
    fn polygon(corners: usize, latitude_deg: f64) -> String {
        let corner = |index: usize| {
            let angle = (index % corners) as f64 * std::f64::consts::TAU / corners as f64;
            format!(
                "[{}, {}]",
                latitude_deg + 0.01 * angle.sin(),
                3.0 + 0.01 * angle.cos()
            )
        };
        let all: Vec<String> = (0..=corners).map(corner).collect();
        format!("polygon = [{}]\n", all.join(", "))
    }

    /// What a reader has of all pieces.
    fn read(outline: &Outline<'_>) -> ipc_types::outline::Outline {
        let mut reader = OutlineReader::new();
        for index in 0..outline.pieces() {
            let piece = outline.piece(index).unwrap();
            assert_eq!(
                reader.take(&piece),
                index + 1 == outline.pieces(),
                "{index}"
            );
        }
        assert_eq!(outline.piece(outline.pieces()), None);
        reader.outline().unwrap().clone()
    }

    #[test]
    fn a_reader_has_the_fence_and_the_path_as_they_are() {
        let fence = fence(&format!(
            "ceiling_m = 120.0\n\
             [[area]]\nname = 'the field \u{e9}'\nkind = 'inclusion'\nfloor_m = 1.5\n{}\
             [[area]]\nname = 'mast'\nkind = 'exclusion'\ncentre = [1.0, 3.0]\nradius_m = 40.0\n",
            polygon(33, 1.0)
        ));
        let path: Vec<Waypoint> = (0..65).map(waypoint).collect();
        let outline = Outline {
            number: 5,
            fence: &fence,
            path: &path,
        };
        assert_eq!(outline.pieces(), 1 + 2 + 1 + 3);
        let read = read(&outline);
        assert_eq!(
            (read.number, read.floor_m, read.ceiling_m),
            (5, None, Some(120.0))
        );
        let [field, mast] = &read.areas[..] else {
            panic!("{read:?}");
        };
        assert_eq!(
            (field.name.as_str(), field.is_inclusion),
            ("the field ?", true)
        );
        assert_eq!((field.floor_m, field.ceiling_m), (Some(1.5), None));
        let OutlineShape::Polygon(corners) = &field.shape else {
            panic!("{field:?}");
        };
        assert_eq!((corners.len(), corners[0]), (33, [1.0, 3.01]));
        assert!(!mast.is_inclusion);
        let (centre, radius_m) = ([1.0, 3.0], 40.0);
        assert_eq!(mast.shape, OutlineShape::Circle { centre, radius_m });
        assert_eq!(read.path.len(), 65);
        assert_eq!(
            (read.path[64].latitude_deg, read.path[64].altitude_m),
            (0.064, 20.5)
        );
    }

    #[test]
    fn the_largest_outline_is_within_the_reader_s_bounds() {
        assert_eq!(MAX_AREAS, fence::MAX_AREAS);
        assert_eq!(MAX_CORNERS, fence::MAX_VERTICES);
        assert_eq!(MAX_WAYPOINTS, assembly::MAX_WAYPOINTS);
        let areas: String = (0..MAX_AREAS)
            .map(|index| {
                let polygon = polygon(MAX_CORNERS, index as f64);
                format!("[[area]]\nname = 'a{index}'\nkind = 'inclusion'\n{polygon}")
            })
            .collect();
        let fence = fence(&areas);
        let path: Vec<Waypoint> = (0..MAX_WAYPOINTS).map(waypoint).collect();
        let outline = Outline {
            number: 1,
            fence: &fence,
            path: &path,
        };
        assert_eq!(outline.pieces(), MAX_PIECES);
        let read = read(&outline);
        assert_eq!(
            (read.areas.len(), read.path.len()),
            (MAX_AREAS, MAX_WAYPOINTS)
        );
    }
}
