//! A document as a tree of nodes with lines. The reader of a format takes nodes; every node that it did not take is
//! looked up in a table of harmless ones, and is a finding otherwise.

use std::cell::Cell;

use super::items::clean;
use crate::error::ReadError;
use crate::model::{LeftOut, OtherKind, Plan};

/// Most different findings about nodes that were not taken; the rest is one more finding.
const MAX_FINDINGS: usize = 64;

/// What a node holds beside other nodes.
pub enum Value {
    Null,
    Flag(bool),
    Number(f64),
    /// A text; of an XML element all of it that lies directly in the element.
    Text(String),
    List,
    Object,
}

/// An element or attribute of XML, or a member or list entry of JSON.
pub struct Node {
    /// Attributes begin with `@`; the entries of the list `items` are called `items[]`; the root of JSON has none.
    pub name: String,
    /// From 1.
    pub line: usize,
    pub value: Value,
    pub nodes: Vec<Node>,
    used: Cell<Used>,
}

/// What a reader has done with a node.
#[derive(Clone, Copy, PartialEq)]
enum Used {
    Nothing,
    /// It was taken; a text in it and the nodes in it count by themselves.
    Taken,
    /// It was taken with its text.
    Read,
    /// All that is in it was dealt with.
    Whole,
}

impl Node {
    pub fn new(name: String, line: usize, value: Value, nodes: Vec<Node>) -> Node {
        let used = Cell::new(Used::Nothing);
        Node {
            name,
            line,
            value,
            nodes,
            used,
        }
    }

    pub fn has(&self, name: &str) -> bool {
        self.nodes.iter().any(|node| node.name == name)
    }

    /// Takes the first node of this name; another one is left. A `null` says as much as no node.
    pub fn one(&self, name: &str) -> Option<&Node> {
        let node = self.nodes.iter().find(|node| node.name == name)?.take();
        (!matches!(node.value, Value::Null)).then_some(node)
    }

    /// Takes all nodes of this name.
    pub fn all(&self, name: &str) -> impl Iterator<Item = &Node> {
        let nodes = self.nodes.iter().filter(move |node| node.name == name);
        nodes.map(Node::take)
    }

    /// Takes the node for itself.
    pub fn take(&self) -> &Node {
        self.used.set(Used::Taken);
        self
    }

    /// Takes the node with everything that is in it.
    pub fn skip(&self) {
        self.used.set(Used::Whole);
    }

    /// Takes the list `name`.
    pub fn list(&self, name: &str) -> Result<&[Node], ReadError> {
        match self.one(name) {
            Some(list) if matches!(list.value, Value::List) => Ok(&list.nodes),
            _ => Err(self.wrong(format!("there is no list `{name}`"))),
        }
    }

    /// Takes the text, without blanks around it.
    pub fn text(&self) -> Option<&str> {
        self.used.set(Used::Read);
        match &self.value {
            Value::Text(text) => Some(text.trim()),
            _ => None,
        }
    }

    /// The number that the whole text is, or that JSON has.
    pub fn number(&self) -> Option<f64> {
        match self.value {
            Value::Number(number) => Some(number),
            _ => whole_number(self.text()?),
        }
    }

    /// `part` of the file with the line of this node.
    pub fn origin(&self, part: &str) -> String {
        format!("{part}, line {}", self.line)
    }

    pub fn wrong(&self, reason: impl std::fmt::Display) -> ReadError {
        ReadError::line(self.line, reason)
    }

    fn local_name(&self) -> &str {
        self.name.rsplit(':').next().unwrap_or_default()
    }

    /// Whether a value of JSON has members, or entries that have some: it says more than a text, a number or a list of
    /// them.
    pub fn is_nested(&self) -> bool {
        let is_structure = |node: &Node| matches!(node.value, Value::List | Value::Object);
        match self.value {
            Value::List => self.nodes.iter().any(is_structure),
            _ => is_structure(self),
        }
    }

    /// What of the node's names, its own or one in it, speaks of flying.
    pub fn of_flying(&self) -> Option<&Node> {
        self.find(&|node| speaks_of_flying(&node.name))
    }

    /// Takes the nodes that a row of harmless names has, unless something in it means something for a flight.
    pub fn skip_all(&self, row: Row, table: &Table) {
        let is_known = |node: &&Node| is_one_of(row, self, node);
        let is_quiet = |node: &&Node| {
            node.find(&|node| has_word(table.flight, &node.name))
                .is_none()
        };
        self.nodes
            .iter()
            .filter(is_known)
            .filter(is_quiet)
            .for_each(Node::skip);
    }

    fn find(&self, is_wanted: &impl Fn(&Node) -> bool) -> Option<&Node> {
        match is_wanted(self) {
            true => Some(self),
            false => self.nodes.iter().find_map(|node| node.find(is_wanted)),
        }
    }
}

/// The number that a text is as a whole, if it is finite.
pub fn whole_number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Names apart by blanks, ` = `, and why nothing follows from them. `a/b` is `b` directly in `a`; a name that begins
/// with a colon has any prefix.
pub type Row = &'static str;

/// What a format says of the nodes that its reader does not take.
pub struct Table {
    /// They change nothing, unless [`Table::flight`] has what is in them, or its name speaks of flying.
    pub harmless: &'static [Row],
    /// They change nothing, whatever is in them, unless [`Table::flight`] has it.
    pub whole: &'static [Row],
    /// They change nothing of the flight, but their author may expect something of them.
    pub named: Row,
    /// What lies in them is data of other programs: it is named, and forbids the flight only if its name speaks of
    /// flying.
    pub open: &'static str,
    /// They mean something for a flight wherever they lie.
    pub flight: &'static str,
}

/// Whether `node`, which lies in `parent`, has one of the names of a row.
fn is_one_of(row: Row, parent: &Node, node: &Node) -> bool {
    let (local, full) = (node.local_name(), node.name.as_str());
    let names = row.split(" = ").next().unwrap_or_default();
    names
        .split_whitespace()
        .any(|name| match name.split_once('/') {
            Some((above, name)) => above == parent.name && name == full,
            None => name == full || name.strip_prefix(':') == Some(local) && full != local,
        })
}

pub fn has_word(words: &str, word: &str) -> bool {
    words.split_whitespace().any(|one| one == word)
}

/// What is said of a file's parts beside its items: like parts are one entry, with the lines of the first.
#[derive(Default)]
pub struct Remarks(Vec<(String, bool, Vec<usize>)>);

impl Remarks {
    /// `forbids` the flight, or is only to be known. What has no line of its own is at line 0.
    pub fn add(&mut self, line: usize, text: impl Into<String>, forbids: bool) {
        let mut text = text.into();
        if self.0.len() >= MAX_FINDINGS && self.0.iter().all(|(other, ..)| *other != text) {
            text = "more is there that is not read".to_owned();
        }
        let is_like = |(other, known, _): &&mut _| (other, known) == (&text, &forbids);
        match self.0.iter_mut().find(is_like) {
            Some((.., lines)) if lines.last() == Some(&line) => {}
            Some((.., lines)) => lines.push(line),
            None => self.0.push((text, forbids, vec![line])),
        }
    }

    /// Adds every node below `parent`, which was taken, that is neither taken nor harmless.
    pub fn add_left(&mut self, parent: &Node, table: &Table) {
        let is_read = parent.used.get() == Used::Read;
        if !is_read && matches!(&parent.value, Value::Text(text) if !text.trim().is_empty()) {
            let text = format!("the text in `{}` is not read", clean(&parent.name));
            self.add(parent.line, text, true);
        }
        for node in &parent.nodes {
            let is_open = has_word(table.open, node.local_name());
            match node.used.get() {
                Used::Whole => {}
                Used::Nothing if !is_open => self.judge(parent, node, table),
                _ => self.add_left(node, table),
            }
        }
    }

    fn judge(&mut self, parent: &Node, node: &Node, table: &Table) {
        let is_open = parent.name.is_empty() || has_word(table.open, parent.local_name());
        let inner = node.find(&|node| has_word(table.flight, node.local_name()));
        let is_in = |rows: &[Row]| rows.iter().any(|row| is_one_of(row, parent, node));
        let is_harmless = !node.is_nested() && is_in(table.harmless);
        let (forbids, culprit) = match inner {
            Some(inner) => (true, inner),
            None if is_in(table.whole) => return,
            None if is_harmless => match node.nodes.iter().find_map(Node::of_flying) {
                Some(inner) => (true, inner),
                None => return,
            },
            None if is_one_of(table.named, parent, node) => (false, node),
            None if is_open => {
                let inner = node.of_flying();
                (inner.is_some(), inner.unwrap_or(node))
            }
            None => (true, node),
        };
        let shown = |node: &Node| clean(node.name.trim_end_matches("[]"));
        let text = match node.name.as_str() {
            name if culprit.name != name => {
                format!("`{}` in `{}` is not read", shown(culprit), shown(node))
            }
            name if name.ends_with("[]") => {
                format!("an entry of `{}` is not read", shown(parent))
            }
            name if parent.name.is_empty() => format!("`{}` is not read", clean(name)),
            name => format!("`{}` in `{}` is not read", clean(name), shown(parent)),
        };
        self.add(culprit.line, text, forbids);
    }

    /// Moves all of it to the plan.
    pub fn finish(self, plan: &mut Plan) {
        plan.left_out
            .extend(self.0.into_iter().map(|(text, forbids, lines)| {
                let places = match lines.as_slice() {
                    [] | [0, ..] => String::new(),
                    [line] => format!("line {line}: "),
                    [first, second] => format!("lines {first} and {second}: "),
                    [first, second, rest @ ..] => {
                        format!("lines {first}, {second} and {} more: ", rest.len())
                    }
                };
                let kind = match forbids {
                    true => OtherKind::Flight,
                    false => OtherKind::Payload,
                };
                let what = places + &text;
                LeftOut { what, kind }
            }));
    }
}

/// Words in the names of data that other programs keep which may say where, how high, how fast or whether something is
/// flown.
pub const FLIGHT_WORDS: &str = "above accion action agl alt altitud altitude altitudes altura amsl aterrizaje ceiling coordenadas \
    coordinates coords cota crs datum delay despegue disabled duration dwell ele elev elevacion elevation enabled epsg espera exclusion fence \
    floor fly geofence geometry height hold holdtime hover inclusion kind land landing lat latitud latitude lng loiter lon longitud \
    longitude loop msl offset pausa pause proj projection radius repeat rpt skip skipped spatial speed srid srs takeoff terrain terreno \
    units velocidad velocity vuelo wait waypoint wkid z";

/// Of these, those that count in the middle of a name, too: `maxaltitude`, `way_point`.
pub const LONG_FLIGHT_WORDS: &str = "altitud altura coordinatesystem elevacion elevation exclusion geofence height inclusion speed takeoff \
    velocidad velocity waypoint";

/// Whether one of the words of a name, `maxAltitude` or `height_m`, is one of [`FLIGHT_WORDS`], or the name has one of
/// [`LONG_FLIGHT_WORDS`] in it. Accents do not count.
pub fn speaks_of_flying(name: &str) -> bool {
    const ACCENTS: [(char, char); 5] = [('á', 'a'), ('é', 'e'), ('í', 'i'), ('ó', 'o'), ('ú', 'u')];
    let mut words = vec![String::new()];
    let mut was_lower = false;
    for letter in name.chars() {
        if !letter.is_alphabetic() || (was_lower && letter.is_uppercase()) {
            words.push(String::new());
        }
        was_lower = letter.is_lowercase();
        if let Some(word) = words.last_mut().filter(|_| letter.is_alphabetic()) {
            let accent = |letter| ACCENTS.iter().find(|(accent, _)| *accent == letter);
            let plain = letter
                .to_lowercase()
                .map(|letter| accent(letter).map_or(letter, |(_, plain)| *plain));
            word.extend(plain);
        }
    }
    let whole = words.concat();
    let mut long = LONG_FLIGHT_WORDS.split_whitespace();
    words.iter().any(|word| has_word(FLIGHT_WORDS, word)) || long.any(|word| whole.contains(word))
}
