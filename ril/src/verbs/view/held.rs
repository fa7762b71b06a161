//! What the bridge holds, as the bridge's own code judges by it and as a page draws it.

use bridge::safety::fence::{Area, AreaConfig, AreaKind, Fence, FenceConfig};
use ipc_types::outline::{Outline, OutlineArea, OutlineShape};
use view::page;

use crate::robot::chart;

/// The fence of an outline.
///
/// # Errors
///
/// What makes it none: a bridge of this version publishes no such outline.
pub(super) fn fence(held: &Outline) -> Result<Fence, String> {
    let areas: Result<Vec<Area>, String> = held.areas.iter().map(area).collect();
    Fence::try_from(FenceConfig {
        floor_m: held.floor_m,
        ceiling_m: held.ceiling_m,
        area: areas?,
    })
}

fn area(held: &OutlineArea) -> Result<Area, String> {
    let (polygon, centre, radius_m) = match &held.shape {
        OutlineShape::Polygon(polygon) => (Some(polygon.clone()), None, None),
        OutlineShape::Circle { centre, radius_m } => (None, Some(*centre), Some(*radius_m)),
    };
    Area::try_from(AreaConfig {
        name: held.name.clone(),
        kind: match held.is_inclusion {
            true => AreaKind::Inclusion,
            false => AreaKind::Exclusion,
        },
        polygon,
        centre,
        radius_m,
        floor_m: held.floor_m,
        ceiling_m: held.ceiling_m,
    })
}

/// The areas of an outline, to be drawn.
pub(super) fn areas(held: &Outline) -> Vec<page::Area> {
    let areas = held.areas.iter();
    areas
        .map(|area| chart::AreaOutline::from(area).into())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outline_is_the_fence_that_it_was_made_of() {
        let shape = |shape, is_inclusion| OutlineArea {
            name: format!("area {is_inclusion}"),
            is_inclusion,
            floor_m: None,
            ceiling_m: Some(80.0),
            shape,
        };
        let polygon = vec![[37.0, -6.0], [37.1, -6.0], [37.1, -6.1]];
        let circle = OutlineShape::Circle {
            centre: [37.05, -6.02],
            radius_m: 20.0,
        };
        let held = Outline {
            number: 3,
            floor_m: Some(2.0),
            ceiling_m: None,
            areas: vec![
                shape(OutlineShape::Polygon(polygon), true),
                shape(circle, false),
            ],
            path: Vec::new(),
        };
        let made = fence(&held).unwrap();
        assert_eq!((made.areas(), made.area_name(1)), (2, Some("area false")));
        let drawn = areas(&held);
        assert_eq!((drawn[0].corners.len(), drawn[1].corners.len()), (3, 32));
        let twice = Outline {
            areas: vec![held.areas[0].clone(), held.areas[0].clone()],
            ..held
        };
        assert!(fence(&twice).is_err(), "two areas of one name");
    }
}
