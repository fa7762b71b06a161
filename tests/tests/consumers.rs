//! The programs of docs/consumers.md, which use iceoryx2's own binding for Python, as they stand there.
//!
//! The binding comes from PyPI into an environment in the target folder. Without network the programs are not run, and
//! that is told; `RIL_TEST_ICEORYX2_PYTHON` names an interpreter that has the binding.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use ipc_types::code::MovementKind;
use ril_tests::languages::{root, skip};
use ril_tests::packages;
use ril_tests::process::Signal;
use ril_tests::{
    Answer, Process, PtyFolder, Received, Script, StandInBridge, StandInStatus, TestDomain,
};

/// The page from its first program with iceoryx2's own binding on; those before it are of `examples.rs`.
fn page() -> String {
    let page = fs::read_to_string(root().join("docs/consumers.md")).expect("the page");
    let (_, own) = page
        .split_once("\n## Programs in Python\n")
        .expect("its heading");
    own.to_owned()
}

/// The programs of `page`, in its order.
fn programs(page: &str) -> Vec<&str> {
    let mut parts = page.split("```").skip(1);
    let mut programs = Vec::new();
    while let Some(block) = parts.next() {
        let program = block.strip_prefix("python\n");
        programs.push(program.expect("a program in Python: others need a test that runs them"));
        parts.next().expect("the end of the block");
    }
    programs
}

/// The requirement that the page gives to pip.
fn requirement(page: &str) -> &str {
    let (_, behind) = page.split_once("`pip install ").expect("a package");
    behind.split('`').next().expect("its end")
}

/// An interpreter with the binding, and a folder with the programs and what they import.
struct Consumers {
    python: PathBuf,
    folder: PathBuf,
}

impl Consumers {
    /// Writes the programs to `folder`.
    fn write(page: &str, folder: &Path, python: PathBuf) -> Consumers {
        let names = ["hero_raw.py", "telemetry.py", "take_off.py"];
        let programs = programs(page);
        assert_eq!(programs.len(), names.len(), "each program has its test");
        for (name, program) in names.iter().zip(programs) {
            fs::write(folder.join(name), program).expect("a file");
        }
        let layouts = root().join("ipc-types/layouts/hero_ipc.py");
        fs::copy(layouts, folder.join("hero_ipc.py")).expect("a file");
        Consumers {
            python,
            folder: folder.to_owned(),
        }
    }

    fn start(&self, domain: &TestDomain, name: &str) -> Process {
        let mut command = Command::new(&self.python);
        command.args(["-B", "-u"]).arg(self.folder.join(name));
        Process::spawn(domain, command)
    }

    /// Telemetry is printed, that of a status that was started again too, and nothing counts as lost.
    fn telemetry(&self) {
        let domain = TestDomain::new();
        let samples = Script::at(37.0, -6.0, 10.0).stand(1.0).hero();
        let status = StandInStatus::start(&domain);
        status.publish(&samples[0]);
        let mut program = self.start(&domain, "telemetry.py");
        program.wait_for_text("1 10.0 lost: 0");
        status.publish(&samples[1]);
        program.wait_for_text("2 10.0 lost: 0");
        drop(status);
        let status = StandInStatus::start(&domain);
        status.publish(&samples[2]);
        program.wait_for_text("1 10.0 lost: 0");
        program.signal(Signal::TERM);
        program.wait_status();
        drop(status);
        domain.sweep();
    }

    /// A take-off is sent and followed to its end, and to the end of a bridge that dies with it.
    fn take_off(&self) {
        let domain = TestDomain::new();
        let bridge = StandInBridge::start(&domain);
        let finished = self.start(&domain, "take_off.py").exits(0);
        assert_eq!(finished.stdout, ["ACCEPTED NONE", "DONE NONE"]);
        let Received::Movement(request) = bridge.next_request() else {
            panic!("a movement was sent");
        };
        assert_eq!(request.kind, MovementKind::TakeOff.code());
        assert_eq!(request.altitude_m, 10.0);

        bridge.answer_next(Answer::Die);
        let finished = self.start(&domain, "take_off.py").exits(1);
        // iceoryx2 may add that services are gone which the bridge takes down at the same moment.
        assert_eq!(
            finished.stderr[0], "the bridge is gone: outcome unknown",
            "{finished:#?}"
        );
        drop(bridge);
        domain.sweep();
    }
}

#[test]
fn the_programs_of_the_page_do_what_it_says() {
    let page = page();
    let folder = PtyFolder::new();
    let python = match std::env::var_os("RIL_TEST_ICEORYX2_PYTHON") {
        Some(python) => python.into(),
        None => match packages::python(requirement(&page)) {
            Ok(python) => python,
            Err(why) => return skip("the programs of docs/consumers.md", &why),
        },
    };
    let programs = folder.link("programs");
    fs::create_dir(&programs).expect("a folder");
    let consumers = Consumers::write(&page, &programs, python);
    consumers.telemetry();
    consumers.take_off();
}
