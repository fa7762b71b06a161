//! A node of a good plan is added, removed, renamed or moved at random: the flight stays as it was, or there is a
//! finding or an error, unless the node is one that may be said or left out: a waypoint, an area, a property.
//!
//! `RIL_PLAN_MUTATIONS=100000 cargo test -p plans structure` plays more of them.

use super::kinds::{Outcome, outcome};

/// An element or attribute of XML, a value of JSON, or a line or column of a list.
#[derive(Clone, Debug)]
struct Tree {
    /// Attributes begin with `@`; entries of lists have the name of the list and `[]`.
    name: String,
    form: Form,
    /// Of a scalar as it is written; of an element its text.
    text: String,
    nodes: Vec<Tree>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Element,
    Attribute,
    Object,
    List,
    Scalar,
}

impl Tree {
    fn new(name: &str, form: Form, text: &str, nodes: Vec<Tree>) -> Tree {
        let (name, text) = (name.to_owned(), text.to_owned());
        Tree {
            name,
            form,
            text,
            nodes,
        }
    }

    fn of_xml(node: roxmltree::Node<'_, '_>) -> Tree {
        let prefix = match node.tag_name().namespace() {
            Some(namespace) if namespace.contains("/ext/") => "gx:",
            _ => "",
        };
        let name = format!("{prefix}{}", node.tag_name().name());
        let attributes = node.attributes().map(|attribute| {
            Tree::new(
                &format!("@{}", attribute.name()),
                Form::Attribute,
                attribute.value(),
                vec![],
            )
        });
        let elements = node
            .children()
            .filter(roxmltree::Node::is_element)
            .map(Tree::of_xml);
        let nodes = attributes.chain(elements).collect();
        Tree::new(
            &name,
            Form::Element,
            node.text().unwrap_or_default().trim(),
            nodes,
        )
    }

    fn of_json(name: &str, value: &serde_json::Value) -> Tree {
        use serde_json::Value;
        match value {
            Value::Object(members) => {
                let nodes = members
                    .iter()
                    .map(|(name, value)| Tree::of_json(name, value))
                    .collect();
                Tree::new(name, Form::Object, "", nodes)
            }
            Value::Array(entries) => {
                let entry = format!("{name}[]");
                let nodes = entries
                    .iter()
                    .map(|value| Tree::of_json(&entry, value))
                    .collect();
                Tree::new(name, Form::List, "", nodes)
            }
            value => Tree::new(name, Form::Scalar, &value.to_string(), vec![]),
        }
    }

    fn of_list(text: &str) -> Tree {
        let column = |text: &str| Tree::new("[][]", Form::Scalar, text, vec![]);
        let line = |line: &str| {
            Tree::new(
                "[]",
                Form::List,
                "",
                line.split_whitespace().map(column).collect(),
            )
        };
        Tree::new("", Form::List, "", text.lines().skip(1).map(line).collect())
    }

    fn write(&self, out: &mut String) {
        match self.form {
            Form::Element => {
                *out += &format!("<{}", self.name);
                if ["kml", "gpx"].contains(&self.name.as_str()) {
                    *out += " xmlns:gx='http://www.google.com/kml/ext/2.2'";
                }
                for node in self
                    .nodes
                    .iter()
                    .filter(|node| node.form == Form::Attribute)
                {
                    *out += &format!(" {}='{}'", &node.name[1..], node.text);
                }
                *out += &format!(">{}", self.text);
                self.nodes
                    .iter()
                    .filter(|node| node.form == Form::Element)
                    .for_each(|node| node.write(out));
                *out += &format!("</{}>\n", self.name);
            }
            Form::Attribute => {}
            Form::Scalar => *out += &self.text,
            Form::Object | Form::List => {
                let is_object = self.form == Form::Object;
                out.push(if is_object { '{' } else { '[' });
                for (index, node) in self.nodes.iter().enumerate() {
                    if index > 0 {
                        *out += ",\n";
                    }
                    if is_object {
                        *out += &format!("\"{}\":", node.name);
                    }
                    node.write(out);
                }
                out.push(if is_object { '}' } else { ']' });
            }
        }
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        let mut text = String::new();
        match name.ends_with(".waypoints") {
            true => {
                text += "QGC WPL 110\n";
                for line in &self.nodes {
                    let mut columns = String::new();
                    line.columns(&mut columns);
                    text += &(columns + "\n");
                }
            }
            false => self.write(&mut text),
        }
        text.into_bytes()
    }

    fn columns(&self, line: &mut String) {
        *line += &format!("{} ", self.text);
        self.nodes.iter().for_each(|column| column.columns(line));
    }

    fn at(&self, path: &[usize]) -> &Tree {
        path.iter().fold(self, |tree, index| &tree.nodes[*index])
    }

    fn at_mut(&mut self, path: &[usize]) -> &mut Tree {
        path.iter()
            .fold(self, |tree, index| &mut tree.nodes[*index])
    }

    fn paths(&self, from: &[usize], all: &mut Vec<Vec<usize>>) {
        all.push(from.to_vec());
        for (index, node) in self.nodes.iter().enumerate() {
            node.paths(&[from, &[index]].concat(), all);
        }
    }

    fn is_container(&self) -> bool {
        matches!(self.form, Form::Element | Form::Object | Form::List)
    }

    /// The entry of a list is called by its list, a node elsewhere by its own name.
    fn put(&mut self, at: usize, mut node: Tree) {
        let is_xml = matches!(node.form, Form::Element | Form::Attribute);
        if is_xml != (self.form == Form::Element) {
            return;
        }
        node.name = match (self.form, node.name.ends_with("[]")) {
            (Form::List, _) => format!("{}[]", self.name),
            (_, true) => "entry".to_owned(),
            _ => node.name,
        };
        self.nodes.insert(at % (self.nodes.len() + 1), node);
    }
}

const PLAN: &str = r#"{"fileType":"Plan","version":1,"groundStation":"QGroundControl","mission":{"version":2,"cruiseSpeed":15,"hoverSpeed":5,
    "firmwareType":12,"vehicleType":4,"globalPlanAltitudeMode":1,"plannedHomePosition":[37.411,-6.001,10],"items":[
    {"type":"SimpleItem","command":22,"frame":3,"doJumpId":1,"autoContinue":true,"AMSLAltAboveTerrain":null,"Altitude":30,
      "AltitudeMode":1,"params":[0,0,0,null,37.411,-6.001,30]},
    {"type":"SimpleItem","command":178,"frame":2,"doJumpId":2,"autoContinue":true,"params":[1,4,-1,0,0,0,0]},
    {"type":"SimpleItem","command":16,"frame":0,"doJumpId":3,"autoContinue":true,"AMSLAltAboveTerrain":null,"Altitude":45,
      "AltitudeMode":2,"params":[3,0,0,null,37.4112,-6.0012,45]},
    {"type":"ComplexItem","complexItemType":"survey","version":5,"angle":0,"polygon":[[37.4112,-6.002],[37.4113,-6.002],[37.4113,-6.0018]],
      "TransectStyleComplexItem":{"version":1,"CameraCalc":{"version":1},"Items":[
        {"type":"SimpleItem","command":16,"frame":3,"doJumpId":4,"autoContinue":true,"params":[0,0,0,null,37.4115,-6.0014,30]},
        {"type":"SimpleItem","command":16,"frame":3,"doJumpId":5,"autoContinue":true,"params":[0,0,0,null,37.4117,-6.0014,30]}]}},
    {"type":"SimpleItem","command":21,"frame":3,"doJumpId":6,"autoContinue":true,"params":[0,0,0,null,37.411,-6.0012,0]}]},
  "geoFence":{"version":2,"polygons":[{"version":1,"inclusion":true,"polygon":[[37.40,-6.01],[37.40,-5.99],[37.42,-5.99],[37.42,-6.01]]}],
    "circles":[{"version":1,"inclusion":false,"circle":{"center":[37.4135,-6.0035],"radius":30}}]},
  "rallyPoints":{"version":2,"points":[]}}"#;

const GEOJSON: &str = r#"{"type":"FeatureCollection","name":"x","bbox":[-7,37,-6,38],"features":[
    {"type":"Feature","id":1,"properties":{"name":"pad","action":"take-off","hold_s":3,"altitude_reference":"take-off"},
      "geometry":{"type":"Point","coordinates":[-6.001,37.411,15]}},
    {"type":"Feature","properties":{"speed_mps":3,"altitude_reference":"sea","stroke":"red"},
      "geometry":{"type":"LineString","coordinates":[[-6.001,37.4114,30],[-6.0014,37.4114,31],[-6.0014,37.4116,35]]}},
    {"type":"Feature","properties":{"action":"hold","hold_s":8,"altitude_reference":"take-off"},
      "geometry":{"type":"Point","coordinates":[-6.0016,37.4116,32]}},
    {"type":"Feature","properties":{"kind":"exclusion","radius_m":25},"geometry":{"type":"Point","coordinates":[-6.0035,37.4135]}},
    {"type":"Feature","properties":{"kind":"inclusion","name":"field"},
      "geometry":{"type":"Polygon","coordinates":[[[-6.01,37.40],[-5.99,37.40],[-5.99,37.42],[-6.01,37.42],[-6.01,37.40]]]}},
    {"type":"Feature","properties":{"action":"land"},"geometry":{"type":"Point","coordinates":[-6.0012,37.411]}}]}"#;

const KML: &str = r#"<kml><Document><name>x</name><Style id="a"><LineStyle/></Style><Schema id="s"><SimpleField name="action"/></Schema><Folder>
  <Placemark><name>pad</name><visibility>1</visibility><ExtendedData><SchemaData schemaUrl="s"><SimpleData name="action">take-off</SimpleData>
    <SimpleData name="altitude_reference">take-off</SimpleData></SchemaData></ExtendedData>
    <Point><altitudeMode>relativeToGround</altitudeMode><coordinates>-6.001,37.411,15</coordinates></Point></Placemark>
  <Placemark><styleUrl>a</styleUrl><LineString><altitudeMode>absolute</altitudeMode><tessellate>1</tessellate>
    <coordinates>-6.001,37.4114,30 -6.0014,37.4114,31</coordinates></LineString></Placemark></Folder>
  <Placemark><ExtendedData><Data name="kind"><value>inclusion</value></Data></ExtendedData><MultiGeometry><Polygon><outerBoundaryIs><LinearRing>
    <coordinates>-6.01,37.40 -5.99,37.40 -5.99,37.42 -6.01,37.42 -6.01,37.40</coordinates></LinearRing></outerBoundaryIs></Polygon></MultiGeometry>
    </Placemark>
  <Placemark><description>x</description><LookAt><longitude>1</longitude></LookAt><ExtendedData><Data name="action"><value>land</value></Data>
    </ExtendedData><Point><coordinates>-6.0012,37.411</coordinates></Point></Placemark></Document></kml>"#;

const ROUTE: &str = r#"<gpx version="1.1" creator="x"><metadata><name>x</name><time>1</time></metadata><rte><name>r</name>
  <rtept lat="37.4112" lon="-6.001"><ele>30</ele><name>A</name><time>2</time><sym>x</sym></rtept><rtept lat="37.4114" lon="-6.001"><ele>31</ele>
  </rtept></rte><trk><trkseg><trkpt lat="37.5" lon="-6.1"><ele>9</ele></trkpt></trkseg></trk></gpx>"#;

const TRACK: &str = r#"<gpx version="1.0" creator="x"><name>x</name><trk><trkseg><trkpt lat="37.4112" lon="-6.001"><ele>30</ele><time>1</time>
  <course>3</course></trkpt><trkpt lat="37.4114" lon="-6.001"><ele>31</ele><fix>3d</fix></trkpt></trkseg></trk></gpx>"#;

const LIST: &str = "QGC WPL 110\n0 1 0 16 0 0 0 0 37.411 -6.001 10 1\n1 0 3 22 0 0 0 0 0 0 20 1\n2 0 3 16 2 0 0 0 37.4112 -6.001 30 1\n\
    3 0 2 178 1 4 -1 0 0 0 0 1\n4 0 0 16 0 0 0 0 37.4114 -6.0012 45 1\n5 0 3 21 0 0 0 0 37.411 -6.0012 0 1\n";

fn plans() -> Vec<(&'static str, Tree)> {
    let xml = |text| Tree::of_xml(roxmltree::Document::parse(text).unwrap().root_element());
    let json = |text| Tree::of_json("", &serde_json::from_str(text).unwrap());
    vec![
        ("x.plan", json(PLAN)),
        ("x.geojson", json(GEOJSON)),
        ("x.kml", xml(KML)),
        ("x.gpx", xml(ROUTE)),
        ("y.gpx", xml(TRACK)),
        ("x.waypoints", Tree::of_list(LIST)),
    ]
}

/// Names that a node can get beside those of the plan itself.
const NAMES: [&str; 14] = [
    "foo",
    "altitude",
    "Height",
    "gx:altitudeOffset",
    "description",
    "name",
    "id",
    "time",
    "extensions",
    "speed",
    "metadata",
    "camera",
    "gx:Track",
    "Style",
];

/// From these names nothing follows: a property that becomes one of them is a property that is left out.
const QUIET: &str = "name description id time bbox stroke styleUrl camera visibility CameraCalc";

fn is_quiet(name: &str) -> bool {
    QUIET
        .split(' ')
        .any(|quiet| quiet == name.trim_end_matches("[]"))
        || name == "polygon[]"
}

/// What may be said in `parent`, or be left out there: a part of the plan of its own, or a property.
fn is_statement(parent: &Tree, node: &Tree) -> bool {
    const PAIRS: &str = "items/items[] Items/Items[] polygons/polygons[] circles/circles[] polygon/polygon[] points/points[] \
        geoFence/polygons geoFence/circles /geoFence /rallyPoints features/features[] coordinates/coordinates[] \
        coordinates[]/coordinates[][] /[] properties/action properties/hold_s properties/speed_mps properties/altitude_reference \
        properties/kind properties/radius_m features[]/properties Document/Placemark Document/Folder Folder/Placemark Folder/Folder \
        Folder/Document Document/Document kml/Document kml/Folder kml/Placemark Placemark/ExtendedData ExtendedData/Data \
        ExtendedData/SchemaData SchemaData/SimpleData MultiGeometry/Point MultiGeometry/LineString MultiGeometry/Polygon \
        MultiGeometry/MultiGeometry gpx/rte gpx/trk gpx/wpt rte/rtept trk/trkseg trkseg/trkpt mission/plannedHomePosition";
    let is_vertex = !parent.name.starts_with("coordinates") || node.form == Form::List;
    let pair = format!("{}/{}", parent.name, node.name);
    is_vertex && PAIRS.split_whitespace().any(|one| one == pair)
}

/// Changes a node, and says what was done, and whether it may change the flight without a word.
fn mutate(tree: &mut Tree, dice: &mut fastrand::Rng) -> (String, bool) {
    let mut paths = Vec::new();
    tree.paths(&[], &mut paths);
    let any = |dice: &mut fastrand::Rng| paths[dice.usize(..paths.len())].clone();
    let mut path = any(dice);
    while path.is_empty() {
        path = any(dice);
    }
    let (index, above) = path.split_last().unwrap();
    let (node, parent) = (tree.at(&path).clone(), tree.at(above).clone());
    let name = match dice.bool() {
        true => NAMES[dice.usize(..NAMES.len())].to_owned(),
        false => tree.at(&any(dice)).name.trim_start_matches('@').to_owned(),
    };
    let is_said = is_statement(&parent, &node);
    match dice.u8(..4) {
        0 => {
            tree.at_mut(above).nodes.remove(*index);
            (format!("remove {path:?} {}", node.name), is_said)
        }
        1 => {
            let old = std::mem::take(&mut tree.at_mut(&path).name);
            let new = match node.form {
                _ if old.ends_with("[]") || name.is_empty() || name.ends_with("[]") => old.clone(),
                Form::Attribute => format!("@{}", name.replace(':', "")),
                _ => name,
            };
            tree.at_mut(&path).name = new.clone();
            let is_new_said =
                is_statement(&parent, tree.at(&path)) || QUIET.split(' ').any(|quiet| quiet == new);
            (
                format!("rename {path:?} {old} to {new}"),
                is_said && is_new_said,
            )
        }
        kind => {
            let mut to = any(dice);
            while !tree.at(&to).is_container() || (kind == 2 && to.starts_with(&path)) {
                to = any(dice);
            }
            let mut node = node;
            if kind == 3 && dice.bool() {
                node.name = match node.form {
                    Form::Attribute => "@foo".to_owned(),
                    _ if name.is_empty() => "foo".to_owned(),
                    _ => name,
                };
            }
            let text = format!(
                "{} {path:?} {} to {to:?}",
                ["move", "add"][usize::from(kind == 3)],
                node.name
            );
            let at = dice.usize(..10);
            let (target, count) = (tree.at(&to).clone(), tree.at(&to).nodes.len());
            tree.at_mut(&to).put(at, node);
            let put = tree
                .at(&to)
                .nodes
                .get(at % (count + 1))
                .filter(|_| tree.at(&to).nodes.len() > count);
            let Some(put) = put.cloned() else {
                return ("nothing".to_owned(), true);
            };
            let is_quiet = is_quiet(&put.name)
                || (matches!(put.form, Form::Scalar | Form::List) && is_quiet(&target.name));
            let is_new_said = is_quiet || is_statement(&target, &put);
            if kind == 3 {
                return (text, is_new_said);
            }
            // Where it was, which its copy may have shifted.
            let mut old = path.clone();
            if above.starts_with(&to) || above == to {
                let place = to.len();
                old[place] += usize::from(at % (count + 1) <= old[place]);
            }
            let (index, above) = old.split_last().unwrap();
            let is_within_numbers =
                to == *above && target.form == Form::List && put.form == Form::Scalar;
            tree.at_mut(above).nodes.remove(*index);
            (text, is_within_numbers || (is_said && is_new_said))
        }
    }
}

#[test]
fn a_node_that_is_added_removed_renamed_or_moved_leaves_the_flight_or_a_finding() {
    let count: u64 =
        std::env::var("RIL_PLAN_MUTATIONS").map_or(600, |count| count.parse().expect("a number"));
    let plans = plans();
    let good: Vec<Outcome> = plans
        .iter()
        .map(|(name, tree)| outcome(name, &tree.bytes(name)).unwrap())
        .collect();
    for one in &good {
        assert!(
            one.findings
                .iter()
                .all(|finding| !finding.starts_with("forbids")),
            "{one:#?}"
        );
    }
    let [mut refused, mut found, mut same, mut said] = [0; 4];
    let mut wrong = Vec::new();
    for seed in 0..count {
        let mut dice = fastrand::Rng::with_seed(seed);
        let which = dice.usize(..plans.len());
        let (name, mut tree) = plans[which].clone();
        let (what, may_change) = mutate(&mut tree, &mut dice);
        let bytes = tree.bytes(name);
        match outcome(name, &bytes) {
            Err(_) => refused += 1,
            Ok(outcome)
                if outcome
                    .findings
                    .iter()
                    .any(|finding| !good[which].findings.contains(finding)) =>
            {
                found += 1
            }
            Ok(outcome) if outcome.flight == good[which].flight => same += 1,
            Ok(_) if may_change => said += 1,
            Ok(outcome) => wrong.push(format!("{name} {seed}: {what}\n  {:?}", outcome.flight)),
        }
    }
    println!(
        "{count} plans: {refused} refused, {found} with a finding, {same} flown as before, {said} say something else"
    );
    assert!(
        wrong.is_empty(),
        "{} of {count}:\n{}",
        wrong.len(),
        wrong[..wrong.len().min(12)].join("\n")
    );
}
