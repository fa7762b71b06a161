//! What is in the page, and in which order.

use std::fmt::Write;

use roxmltree::Document;

use crate::sample::{elements, usual};

#[test]
fn the_page_has_headings_alternatives_and_tables() {
    let page = flight_report::page(&usual()).unwrap();
    let mut outline = String::new();
    for element in elements(&page) {
        let attribute = |name: &str| element.attributes.get(name).map_or("", String::as_str);
        let text = element.text.trim();
        match element.name.as_str() {
            "h1" | "h2" | "h3" | "caption" | "td" | "li" | "dt" | "dd" | "p" | "footer"
            | "title" => {
                writeln!(outline, "{} {text}", element.name).unwrap();
            }
            "th" => writeln!(outline, "th scope={} {text}", attribute("scope")).unwrap(),
            "svg" => writeln!(
                outline,
                "svg {} {}",
                attribute("class"),
                attribute("aria-label")
            )
            .unwrap(),
            "span" if !text.is_empty() => writeln!(outline, "span {text}").unwrap(),
            "a" if element.attributes.contains_key("tabindex") => {}
            "a" => writeln!(outline, "a {} {text}", attribute("href")).unwrap(),
            _ => {}
        }
    }
    insta::assert_snapshot!(outline, @r"
    title Flight of robot 1
    h1 Flight of robot 1
    p 2026-11-22 11:54:43 to 11:56:43 UTC
    a #summary Summary
    a #track Track
    a #altitude Altitude
    a #link Link
    a #ages Ages
    a #events Events
    a #requests Requests
    a #about Recording
    h2 Summary
    p The helicopter took off once.
    li 
    a #t2 1:00 no sample for 4.0 s in flight
    dt duration
    dd 2m00s, 5800 rows
    li One line is damaged.
    h2 Track
    li 
    span track
    li 
    span plan
    li 
    span fence: stay inside
    li 
    span fence: stay outside
    li 
    span alarm
    p North up. The zero is the first place of the track, 37.411000°, -6.001000°. Numbers beside rings are those of the
    a #events events.
    svg wide Track seen from above, 49.0 m from west to east and 48.0 m from south to north; plan of 2 waypoints; fence of 2 areas
    svg narrow Track seen from above, 49.0 m from west to east and 48.0 m from south to north; plan of 2 waypoints; fence of 2 areas
    h2 Over time
    h3 What it did
    li 
    span on the ground
    li 
    span flying the path
    li 
    span landing
    li 
    span no sample
    li 
    span alarm
    li 
    span warning
    li 
    span request
    svg wide States over time. phase: on the ground from 0.0 s, flying the path from 10.0 s, landing from 1:40. requests: goto, 4 waypoints from 9.0 s. link: up from 0.0 s, gone from 1:00
    svg narrow States over time. phase: on the ground from 0.0 s, flying the path from 10.0 s, landing from 1:40. requests: goto, 4 waypoints from 9.0 s. link: up from 0.0 s, gone from 1:00
    h3 Altitude
    span in m
    li 
    span GPS
    li 
    span asked for
    li 
    span ceiling: 14.0 m
    p With the zero of telemetry.
    svg wide Altitude over time. GPS between 5.0 and 15.0 m, 10.0 at first and 7.3 at last. asked for between 5.0 and 15.0 m, 10.0 at first and 7.3 at last
    svg narrow Altitude over time. GPS between 5.0 and 15.0 m, 10.0 at first and 7.3 at last. asked for between 5.0 and 15.0 m, 10.0 at first and 7.3 at last
    h3 Link
    span in 1/s
    li 
    span samples
    svg wide Link over time. samples: 5800 in all, at most 50.0 1/s
    svg narrow Link over time. samples: 5800 in all, at most 50.0 1/s
    h3 Ages
    span in ms
    li 
    span between two samples
    svg wide Ages over time. between two samples between 20.0 and 20.0 ms, 20.0 at first and 20.0 at last
    svg narrow Ages over time. between two samples between 20.0 and 20.0 ms, 20.0 at first and 20.0 at last
    p Nothing to draw: fuel.
    caption Values of the plots
    th scope=col Value
    th scope=col Unit
    th scope=col Least
    th scope=col Greatest
    th scope=col First
    th scope=col Last
    th scope=row Altitude: GPS
    td m
    td 5.0
    td 15.0
    td 10.0
    td 7.3
    th scope=row Altitude: asked for
    td m
    td 5.0
    td 15.0
    td 10.0
    td 7.3
    th scope=row Ages: between two samples
    td ms
    td 20.0
    td 20.0
    td 20.0
    td 20.0
    h2 Events
    p A time leads to the plots, where a line marks it; a line of a plot leads to its row here.
    th scope=col #
    th scope=col Time
    th scope=col UTC
    th scope=col Kind
    th scope=col What happened
    td 1
    td 
    a #t1 10.0 s
    td 11:54:53.0
    td 
    span note
    td took off
    td 2
    td 
    a #t2 1:00
    td 11:55:43.0
    td 
    span alarm
    td no sample for 4.0 s in flight
    td 3
    td 
    a #t3 1:10
    td 11:55:53.0
    td 
    span warning
    td 3 samples were lost
    p Of kinds that came too often, 7 more events are not shown.
    h2 Requests
    th scope=col Time
    th scope=col Request
    th scope=col Sender
    th scope=col Outcome
    th scope=col Took
    td 9.0 s
    td goto, 4 waypoints
    td ril (812)
    td 
    span aborted: path-replaced
    td 1:26
    h2 Recording
    caption The log
    th scope=row file
    td log/hero(1)_22_11_26-11_54_43.tsv
    footer Times without a date count from the first sample of the recording. Made by the HERO RIL; the page loads nothing and runs nothing.
    ");
}

#[test]
fn a_link_leads_from_each_event_to_its_mark_in_every_plot_and_back() {
    let flight = usual();
    let page = flight_report::page(&flight).unwrap();
    let elements = elements(&page);
    for number in 1..=flight.events.len() {
        let has = |name: &str, attribute: &str, value: &str| {
            let found = elements.iter().filter(|element| {
                element.name == name
                    && element
                        .attributes
                        .get(attribute)
                        .is_some_and(|found| found == value)
            });
            found.count()
        };
        assert_eq!(has("span", "id", &format!("t{number}")), 1);
        assert_eq!(has("tr", "id", &format!("e{number}")), 1);
        assert!(has("a", "href", &format!("#t{number}")) >= 1);
        let mark = format!("m{number}");
        let marks = elements.iter().filter(|element| {
            let classes = element.attributes.get("class").map_or("", String::as_str);
            element.name == "line" && classes.split(' ').any(|class| class == mark)
        });
        // Three plots and the timeline, each wide and narrow.
        assert_eq!(marks.count(), 8);
        assert!(page.contains(&format!("#t{number}:target~.plots .m{number}")));
    }
}

#[test]
fn every_plot_is_a_file_that_says_what_it_is() {
    let papers = flight_report::papers(&usual()).unwrap();
    let names: Vec<&str> = papers.iter().map(|paper| paper.name).collect();
    assert_eq!(names, ["track", "timeline", "altitude", "link", "ages"]);
    for paper in &papers {
        let document = Document::parse(&paper.svg).unwrap();
        let root = document.root_element();
        assert_eq!(
            root.tag_name().namespace(),
            Some("http://www.w3.org/2000/svg")
        );
        let title = root
            .children()
            .find(|node| node.has_tag_name(("http://www.w3.org/2000/svg", "title")));
        assert!(
            title
                .and_then(|title| title.text())
                .unwrap()
                .starts_with("Flight of robot 1: ")
        );
    }
    let altitude = &papers[2].svg;
    for text in [
        "altitude (m)",
        "GPS",
        "asked for",
        "time since the beginning",
    ] {
        assert!(altitude.contains(text), "{text}");
    }
}
