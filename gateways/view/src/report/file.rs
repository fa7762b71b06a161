//! [`page()`]: the page's files and the flight in one HTML file.
//!
//! A browser loads no module from beside a file, so the modules of the page become one script: each a function that
//! runs once, in an order in which what it imports has run. The page's policy names the hashes of this script and of
//! the style sheet: nothing else runs, and nothing is loaded.

use std::fmt::Write as _;

use data_encoding::BASE64;
use sha2::{Digest as _, Sha256};

use super::data;
use super::flight::FlightReport;

/// A file of the page.
macro_rules! of_page {
    ($path:literal) => {
        include_str!(concat!("../../page/", $path))
    };
}

/// What stands where in it: a line with one of [`PARTS`] alone.
const OUTLINE: &str = of_page!("report/report.html");

/// Lines of the outline that are replaced, in their order.
const PARTS: [&str; 4] = ["{policy}", "{style}", "{flight}", "{script}"];

/// Comes before all libraries, one of which reads this number once. Paper has more pixels than most screens: what is
/// drawn has at least two for each of the page.
const PIXELS: &str =
    "globalThis.devicePixelRatio = Math.max(2, globalThis.devicePixelRatio || 1);\n";

/// Libraries, which are scripts of their own, each with its licence.
const LIBRARIES: [[&str; 2]; 2] = [
    [
        of_page!("vendor/leaflet.LICENSE"),
        of_page!("vendor/leaflet.js"),
    ],
    [
        of_page!("vendor/uplot.LICENSE"),
        of_page!("vendor/uplot.js"),
    ],
];

const STYLES: [&str; 4] = [
    of_page!("vendor/leaflet.css"),
    of_page!("vendor/uplot.css"),
    of_page!("theme.css"),
    of_page!("report/report.css"),
];

/// Modules with their names, each after those that it imports.
const MODULES: [(&str, &str); 14] = [
    ("dom", of_page!("dom.js")),
    ("format", of_page!("format.js")),
    ("geo", of_page!("geo.js")),
    ("history", of_page!("history.js")),
    ("orders", of_page!("orders.js")),
    ("model", of_page!("model.js")),
    ("theme", of_page!("theme.js")),
    ("marks", of_page!("marks.js")),
    ("map", of_page!("map.js")),
    ("plot", of_page!("plot.js")),
    ("replay", of_page!("replay.js")),
    ("tables", of_page!("report/tables.js")),
    ("figures", of_page!("report/figures.js")),
    ("report", of_page!("report/report.js")),
];

/// The page of `flight`, an HTML file.
pub fn page(flight: &FlightReport) -> String {
    let (style, script) = (style(), script());
    let policy = format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src '{}'; style-src '{}'; \
         img-src data:; base-uri 'none'; form-action 'none'\">",
        hash(&script),
        hash(&style)
    );
    let flight = data::json(flight);
    let parts = [
        policy,
        format!("<style>{style}</style>"),
        format!("<script type=\"application/json\" id=\"flight\">{flight}</script>"),
        format!("<script>{script}</script>"),
    ];
    let mut page = String::new();
    for line in OUTLINE.lines() {
        let part = PARTS.iter().position(|part| *part == line);
        page += part.map_or(line, |index| &parts[index]);
        page.push('\n');
    }
    page
}

/// The hash by which the policy of a page names a script or a style sheet.
fn hash(text: &str) -> String {
    format!("sha256-{}", BASE64.encode(&Sha256::digest(text)))
}

/// The style sheets as one. Here and in the script, every end of a line is `\n`, as which a browser reads it: the hash
/// is of that.
fn style() -> String {
    STYLES.concat().replace('\r', "")
}

/// Libraries and modules as one script.
fn script() -> String {
    let mut script = PIXELS.to_owned();
    for [licence, library] in LIBRARIES {
        // Writing to a string cannot fail.
        let _ = writeln!(script, "/*\n{licence}*/\n{library}");
    }
    script += "(() => {\n\"use strict\";\n";
    for (name, source) in MODULES {
        module(&mut script, name, source);
    }
    script += "})();\n";
    script.replace('\r', "")
}

/// A module as a function that runs once and gives what it exports.
fn module(script: &mut String, name: &str, source: &str) {
    let _ = writeln!(script, "const module_{name} = (() => {{");
    let mut exports = Vec::new();
    for line in source.lines() {
        if let Some(import) = line.strip_prefix("import ") {
            let _ = writeln!(script, "{}", imported(import));
            continue;
        }
        let inner = line.strip_prefix("export ");
        exports.extend(inner.and_then(exported));
        let _ = writeln!(script, "{}", inner.unwrap_or(line));
    }
    let _ = writeln!(script, "return {{ {} }};\n}})();", exports.join(", "));
}

/// `{ a, b as c } from "./x.js";` and `* as x from "./x.js";` as declarations.
fn imported(import: &str) -> String {
    let (names, path) = import.split_once(" from ").unwrap_or_default();
    let file = path.trim_end_matches(['"', ';']).trim_end_matches(".js");
    let module = file.rsplit('/').next().unwrap_or_default();
    let names = names.strip_prefix("* as ").unwrap_or(names);
    format!("const {} = module_{module};", names.replace(" as ", ": "))
}

/// The name that `function a(`, `async function a(`, `class A ` or `const a =` declares.
fn exported(declaration: &str) -> Option<&str> {
    let rest = declaration.strip_prefix("async ").unwrap_or(declaration);
    let (_, rest) = rest.split_once(' ')?;
    rest.split(|letter: char| !letter.is_alphanumeric() && letter != '_')
        .next()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_module_becomes_a_function_that_gives_what_it_exports() {
        let mut script = String::new();
        let source = "import { a, b as c } from \"./one.js\";\nimport * as two from \"../two.js\";\nexport const X = 1;\n\
            export async function y() {}\nexport class Z {}\nlet hidden = 2;\n";
        module(&mut script, "m", source);
        assert_eq!(
            script,
            "const module_m = (() => {\nconst { a, b: c } = module_one;\nconst two = module_two;\nconst X = 1;\n\
             async function y() {}\nclass Z {}\nlet hidden = 2;\nreturn { X, y, Z };\n})();\n"
        );
    }

    #[test]
    fn every_module_comes_after_those_that_it_imports() {
        let mut before = Vec::new();
        for (name, source) in MODULES {
            for import in source
                .lines()
                .filter_map(|line| line.strip_prefix("import "))
            {
                let declaration = imported(import);
                let module = declaration.rsplit("module_").next().unwrap();
                assert!(
                    before.contains(&module.trim_end_matches(';')),
                    "{name}: {import}"
                );
            }
            // These forms have no name that can be given on.
            for form in ["export default", "export {", "export *", "export let"] {
                assert!(!source.contains(&format!("\n{form}")), "{name}: {form}");
            }
            before.push(name);
        }
    }

    #[test]
    fn nothing_in_script_or_style_ends_its_element() {
        for text in [script(), style()] {
            let lower = text.to_lowercase();
            for end in ["</script", "</style", "<!--", "\r"] {
                assert!(!lower.contains(end), "{end}");
            }
        }
        for part in PARTS {
            assert_eq!(
                OUTLINE.lines().filter(|line| *line == part).count(),
                1,
                "{part}"
            );
        }
    }
}
