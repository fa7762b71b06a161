//! The picture of `ril watch` in the documentation.

#[path = "../../../examples/picture/svg.rs"]
mod svg;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use roxmltree::Document;

fn texts(picture: &str) -> Vec<String> {
    let document = Document::parse(picture).expect("a well-formed picture");
    let root = document.root_element();
    assert_eq!(root.tag_name().name(), "svg");
    assert_eq!(
        root.tag_name().namespace(),
        Some("http://www.w3.org/2000/svg")
    );
    let texts = root
        .descendants()
        .filter(|node| node.has_tag_name(("http://www.w3.org/2000/svg", "text")));
    texts
        .filter_map(|node| node.text().map(str::to_owned))
        .collect()
}

#[test]
fn what_a_buffer_shows_is_in_its_picture() {
    let mut buffer = Buffer::empty(Rect::new(0, 0, 20, 2));
    buffer.set_string(2, 0, "a < b & \"c\"", Style::new());
    let alarm = Style::new().fg(Color::Red).add_modifier(Modifier::REVERSED);
    buffer.set_string(0, 1, "alarm", alarm);
    let picture = svg::svg(&buffer, "<title>");
    assert_eq!(texts(&picture), ["<title>", "a < b & \"c\"", "alarm"]);
    assert!(picture.contains("fill=\"#f0716b\""), "{picture}");
    texts(&svg::svg(&Buffer::empty(Rect::ZERO), ""));
}

#[test]
fn the_picture_of_the_documentation_is_one_of_a_flight() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/watch.svg");
    let picture = std::fs::read_to_string(file).expect("the picture");
    let texts = texts(&picture).join("\n");
    for expected in [
        "ril watch",
        "robot 1",
        "flying the path, waypoint 3 of 4",
        "in the air",
        "h hold",
    ] {
        assert!(texts.contains(expected), "{expected}:\n{texts}");
    }
    let link = texts.lines().find(|line| line.starts_with("up "));
    assert!(
        link.is_some_and(|link| !link.starts_with("up 0s")),
        "{link:?}"
    );
}
