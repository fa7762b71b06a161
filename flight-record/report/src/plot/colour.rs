//! The palette: that of Okabe and Ito, whose colours also people tell apart who do not see red or green. Each has a lighter shade for
//! a dark page; a plot is drawn with the shade for paper, and the style sheet of a dark page replaces it.

use std::fmt::Write;

use plotters::style::RGBColor;

use crate::flight::Ink;

/// A colour: on paper, and on a dark page.
pub struct Shade {
    /// Red, green, blue on white.
    pub paper: RGBColor,
    dark: RGBColor,
}

impl Shade {
    const fn new(paper: (u8, u8, u8), dark: (u8, u8, u8)) -> Shade {
        Shade {
            paper: RGBColor(paper.0, paper.1, paper.2),
            dark: RGBColor(dark.0, dark.1, dark.2),
        }
    }
}

/// Text and lines that must be read.
pub const TEXT: Shade = Shade::new((0x24, 0x2A, 0x33), (0xE3, 0xE6, 0xEB));
/// Axes.
pub const AXIS: Shade = Shade::new((0x8A, 0x92, 0x9E), (0x7D, 0x86, 0x94));
/// The grid.
pub const GRID: Shade = Shade::new((0xDF, 0xE2, 0xE7), (0x33, 0x3A, 0x45));
/// What lies behind a text in a plot.
pub const PAGE: Shade = Shade::new((0xFF, 0xFF, 0xFE), (0x16, 0x1A, 0x20));

const BLUE: Shade = Shade::new((0x00, 0x72, 0xB2), (0x5A, 0xB4, 0xEC));
const ORANGE: Shade = Shade::new((0xD5, 0x5E, 0x00), (0xF5, 0x8F, 0x44));
const GREEN: Shade = Shade::new((0x00, 0x8F, 0x68), (0x38, 0xC8, 0x9C));
const PURPLE: Shade = Shade::new((0x9A, 0x4C, 0x86), (0xDE, 0x96, 0xCB));
const YELLOW: Shade = Shade::new((0xC9, 0x8A, 0x00), (0xF0, 0xC0, 0x4A));
const RED: Shade = Shade::new((0xC6, 0x28, 0x28), (0xFF, 0x7A, 0x73));
const GREY: Shade = Shade::new((0x6C, 0x75, 0x82), (0x9A, 0xA3, 0xB0));

/// All colours that a plot can have.
const ALL: [&Shade; 11] = [
    &TEXT, &AXIS, &GRID, &PAGE, &BLUE, &ORANGE, &GREEN, &PURPLE, &YELLOW, &RED, &GREY,
];

/// All colours of values, each with the name of its class in the page.
pub const INKS: [(Ink, &str); 7] = [
    (Ink::Blue, "blue"),
    (Ink::Orange, "orange"),
    (Ink::Green, "green"),
    (Ink::Purple, "purple"),
    (Ink::Yellow, "yellow"),
    (Ink::Red, "red"),
    (Ink::Grey, "grey"),
];

impl Ink {
    /// Its shades.
    pub(crate) const fn shade(self) -> &'static Shade {
        match self {
            Ink::Blue => &BLUE,
            Ink::Orange => &ORANGE,
            Ink::Green => &GREEN,
            Ink::Purple => &PURPLE,
            Ink::Yellow => &YELLOW,
            Ink::Red => &RED,
            Ink::Grey => &GREY,
        }
    }

    /// Its name, which is a class of the page.
    pub(crate) fn name(self) -> &'static str {
        let name = INKS.iter().find(|(ink, _)| *ink == self);
        name.map_or("grey", |(_, name)| name)
    }
}

/// A colour as the drawing library writes it.
pub fn hex(colour: RGBColor) -> String {
    format!("#{:02X}{:02X}{:02X}", colour.0, colour.1, colour.2)
}

/// Rules of a style sheet: the colour of each class.
pub fn classes(is_dark: bool) -> String {
    let mut rules = String::new();
    for (ink, name) in INKS {
        let shade = ink.shade();
        let colour = hex(if is_dark { shade.dark } else { shade.paper });
        // Writing to a string cannot fail.
        let _ = writeln!(rules, ".{name}{{--ink:{colour}}}");
    }
    rules
}

/// Rules of a style sheet that replace the colours of the plots on a dark page.
pub fn dark_rules() -> String {
    let mut rules = String::new();
    for shade in ALL {
        let (paper, dark) = (hex(shade.paper), hex(shade.dark));
        let _ = writeln!(
            rules,
            "svg [fill=\"{paper}\"]{{fill:{dark}}}svg [stroke=\"{paper}\"]{{stroke:{dark}}}"
        );
    }
    rules
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Contrast of two colours as WCAG 2 defines it.
    fn contrast(one: RGBColor, other: RGBColor) -> f64 {
        let luminance = |RGBColor(red, green, blue): RGBColor| {
            let linear = |value: u8| {
                let value = f64::from(value) / 255.0;
                if value <= 0.04045 {
                    value / 12.92
                } else {
                    ((value + 0.055) / 1.055).powf(2.4)
                }
            };
            0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue)
        };
        let (one, other) = (luminance(one), luminance(other));
        (one.max(other) + 0.05) / (one.min(other) + 0.05)
    }

    #[test]
    fn every_colour_is_seen_on_paper_and_on_a_dark_page() {
        for (ink, name) in INKS {
            let shade = ink.shade();
            assert!(contrast(shade.paper, PAGE.paper) >= 2.9, "{name} on paper");
            assert!(
                contrast(shade.dark, PAGE.dark) >= 5.0,
                "{name} on a dark page"
            );
        }
        for (shade, least) in [(&TEXT, 7.0), (&AXIS, 3.0)] {
            assert!(contrast(shade.paper, PAGE.paper) >= least);
            assert!(contrast(shade.dark, PAGE.dark) >= least);
        }
    }

    #[test]
    fn no_two_colours_are_the_same_so_that_each_has_one_rule() {
        let papers: BTreeSet<String> = ALL.iter().map(|shade| hex(shade.paper)).collect();
        assert_eq!(papers.len(), ALL.len());
        assert_eq!(dark_rules().lines().count(), ALL.len());
    }
}
