//! Texts of a file that mean harm.

use std::collections::BTreeSet;

use roxmltree::Document;

use crate::sample::{elements, flight, usual};

/// What a file may hold to get a script, an element, an attribute or a link into the page.
const HARM: [&str; 10] = [
    "<script>alert(1)</script>",
    "</title></style></svg></text><script src=//evil.example/x.js></script>",
    "\"><img src=x onerror=alert(1)>",
    "' onmouseover='alert(1)",
    "javascript:alert(1)",
    "]]><!--<svg onload=alert(1)>-->",
    "&lt;script&gt; &#60;script&#62; &amp;",
    "\u{1b}]0;title\u{7}\u{0}\u{8}\u{202e}\u{feff}\u{ffff}",
    "{{7*7}} ${7*7} <%= 7*7 %>",
    "<a href=\"http://evil.example\" style=\"position:fixed\">click</a>",
];

/// All elements that a page has, and that may be in it.
const ELEMENTS: [&str; 44] = [
    "html",
    "head",
    "meta",
    "title",
    "style",
    "body",
    "header",
    "h1",
    "h2",
    "h3",
    "p",
    "nav",
    "a",
    "main",
    "section",
    "ul",
    "li",
    "dl",
    "div",
    "dt",
    "dd",
    "figure",
    "figcaption",
    "span",
    "svg",
    "g",
    "line",
    "polyline",
    "polygon",
    "rect",
    "circle",
    "text",
    "details",
    "summary",
    "table",
    "caption",
    "thead",
    "tbody",
    "tr",
    "th",
    "td",
    "footer",
    "path",
    "desc",
];

/// Attributes by which something is loaded or run.
fn is_harmless(attribute: &str) -> bool {
    let loads = [
        "src",
        "srcset",
        "style",
        "action",
        "formaction",
        "data",
        "xlink:href",
        "poster",
        "background",
        "ping",
    ];
    !attribute.starts_with("on") && !loads.contains(&attribute)
}

fn check(page: &str) {
    let elements = elements(page);
    let ids: Vec<&str> = elements
        .iter()
        .filter_map(|element| element.attributes.get("id"))
        .map(String::as_str)
        .collect();
    let unique: BTreeSet<&str> = ids.iter().copied().collect();
    assert_eq!(unique.len(), ids.len(), "an id is there twice");
    for element in &elements {
        assert!(
            ELEMENTS.contains(&element.name.as_str()),
            "<{}>",
            element.name
        );
        for (name, value) in &element.attributes {
            assert!(is_harmless(name), "<{} {name}={value}>", element.name);
            if name == "href" {
                let target = value.strip_prefix('#').expect("a link into the page");
                assert!(unique.contains(target), "{value} leads nowhere");
            }
        }
    }
}

#[test]
fn no_text_of_a_file_becomes_more_than_text() {
    for harm in HARM {
        for flight in [
            flight(|_| harm.to_owned()),
            flight(|text| format!("{text}{harm}")),
        ] {
            let page = flight_report::page(&flight).unwrap();
            check(&page);
            let is_text = |letter: char| letter == '\n' || !letter.is_control();
            assert!(
                page.chars().all(is_text),
                "a control character is in the page"
            );
            assert!(
                !page.contains('\u{202e}'),
                "the direction of text is turned"
            );
            for paper in flight_report::papers(&flight).unwrap() {
                let document = Document::parse(&paper.svg)
                    .unwrap_or_else(|error| panic!("{}: {error}", paper.name));
                for node in document.descendants().filter(|node| node.is_element()) {
                    assert!(
                        ELEMENTS.contains(&node.tag_name().name()),
                        "{}: {node:?}",
                        paper.name
                    );
                    assert!(
                        node.attributes()
                            .all(|attribute| is_harmless(attribute.name()))
                    );
                }
            }
        }
    }
}

#[test]
fn a_page_allows_nothing_to_be_loaded_or_run() {
    let page = flight_report::page(&usual()).unwrap();
    check(&page);
    let policy = elements(&page)
        .into_iter()
        .find(|element| {
            element
                .attributes
                .get("http-equiv")
                .is_some_and(|name| name == "Content-Security-Policy")
        })
        .expect("a policy");
    assert!(policy.attributes["content"].contains("default-src"));
    for word in ["http://", "https://", "url(", "@import", "<script", "<link"] {
        assert!(!page.contains(word), "{word}");
    }
}

#[test]
fn megabytes_of_text_do_not_make_a_page_of_megabytes() {
    let long = "x".repeat(1_000_000);
    let mut flight = usual();
    flight.title.clone_from(&long);
    for event in &mut flight.events {
        event.text.clone_from(&long);
    }
    flight.metadata[0].rows[0].1.clone_from(&long);
    flight.summary[0].clone_from(&long);
    let page = flight_report::page(&flight).unwrap();
    assert!(page.len() < 1_200_000, "{}", page.len());
}
