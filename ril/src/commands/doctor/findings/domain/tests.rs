//! Tables of what can be seen of a domain, and what is said of it.

use std::time::Duration;

use super::super::super::facts::Trouble;
use super::super::Severity::{self, Error, Note, Warning};
use super::*;

/// Nobody's: this user is another.
const STRANGER: u32 = u32::MAX - 7;

fn ours() -> u32 {
    rustix::process::geteuid().as_raw()
}

fn entry(path: &str, is_folder: bool, uid: u32, mode: u32) -> Entry {
    Entry {
        path: path.into(),
        is_folder,
        uid,
        mode,
    }
}

fn node(life: Life, pid: u32, process: &str) -> NodeFacts {
    NodeFacts {
        life,
        pid,
        process: process.to_owned(),
    }
}

fn segment(uid: u32, mode: u32, defect: Option<&'static str>) -> Management {
    Management {
        entry: entry("/dev/shm/lab_0.global_mgmt", false, uid, mode),
        defect,
    }
}

/// A domain in which a bridge lives.
fn healthy() -> Inspection {
    Inspection {
        root: Some(entry("/tmp/lab", true, ours(), 0o700)),
        management: vec![segment(ours(), 0o600, None)],
        nodes: vec![node(Life::Live, 7, "bridge")],
        unfinished: 0,
        entries: 23,
        strangers: Vec::new(),
        foreign: Vec::new(),
    }
}

fn nothing() -> Inspection {
    Inspection {
        root: None,
        management: Vec::new(),
        nodes: Vec::new(),
        entries: 0,
        ..healthy()
    }
}

fn domain(inspection: Inspection) -> DomainFacts {
    DomainFacts {
        prefix: "lab_".to_owned(),
        root: "/tmp/lab".into(),
        inspection: Ok(inspection),
        providers: Ok(providers([Some("bridge"), Some("status")])),
        stopped: Vec::new(),
    }
}

/// All services, the bridge's and status' provided by these.
fn providers([bridge, status]: [Option<&str>; 2]) -> Vec<(ServiceId, Option<Provider>)> {
    let provider = |name: Option<&str>| {
        name.map(|process| Provider {
            pid: process.len() as u32,
            process: process.to_owned(),
            since_ns: 1,
        })
    };
    ipc_types::service::SERVICES
        .iter()
        .map(|spec| match spec.id {
            ServiceId::HeroTelemetry => (spec.id, provider(status)),
            _ => (spec.id, provider(bridge)),
        })
        .collect()
}

/// What is not in order, by severity and name.
fn troubles(domain: &DomainFacts) -> Vec<(Severity, &'static str)> {
    let findings = diagnose(domain, 1);
    for finding in &findings {
        assert!(
            finding.severity == Note || finding.next_step.is_some(),
            "no next step: {finding:?}"
        );
    }
    findings
        .iter()
        .filter(|finding| finding.severity > Note)
        .map(|finding| (finding.severity, finding.id))
        .collect()
}

#[test]
fn what_is_in_order_gives_notes_alone() {
    for inspection in [healthy(), nothing()] {
        assert_eq!(troubles(&domain(inspection)), []);
    }
    let ids: Vec<_> = diagnose(&domain(healthy()), 1)
        .iter()
        .map(|finding| finding.id)
        .collect();
    assert_eq!(
        ids,
        [
            "root-right",
            "management-right",
            "processes",
            "service-right",
            "service-right"
        ]
    );
}

#[test]
fn each_trouble_has_its_name() {
    let root = |is_folder, uid, mode| Inspection {
        root: Some(entry("/tmp/lab", is_folder, uid, mode)),
        ..healthy()
    };
    let management = |uid, mode, defect| Inspection {
        management: vec![segment(uid, mode, defect)],
        ..healthy()
    };
    let nodes = |nodes: &[NodeFacts]| Inspection {
        nodes: nodes.to_vec(),
        ..healthy()
    };
    let live = node(Life::Live, 7, "bridge");
    let dead = node(Life::Dead, 8, "bridge");
    let unclear = node(Life::Unclear, 9, "");
    #[rustfmt::skip]
    let cases: [(Inspection, &[(Severity, &str)]); 15] = [
        (root(false, ours(), 0o700), &[(Error, "root-not-a-folder")]),
        (root(true, STRANGER, 0o700), &[(Error, "root-of-another-user")]),
        (root(true, ours(), 0o777), &[(Error, "root-open")]),
        (root(true, ours(), 0o720), &[(Error, "root-open")]),
        (root(true, ours(), 0o755), &[(Warning, "root-readable")]),
        (root(true, ours(), 0o500), &[(Error, "root-closed")]),
        (management(STRANGER, 0o600, None), &[(Error, "management-of-another-user")]),
        (management(ours(), 0o600, Some("it is empty")), &[(Warning, "management-spoiled")]),
        (management(ours(), 0o666, None), &[(Warning, "management-open")]),
        (nodes(&[live.clone(), dead.clone()]), &[(Warning, "dead-nodes")]),
        (nodes(&[live.clone(), unclear]), &[(Warning, "nodes-unclear")]),
        (nodes(&[dead]), &[(Warning, "dead-nodes")]),
        (Inspection { unfinished: 2, ..healthy() }, &[(Warning, "half-made")]),
        (nodes(&[]), &[(Warning, "residue")]),
        (Inspection { entries: 3, ..nothing() }, &[(Warning, "residue")]),
    ];
    for (inspection, expected) in cases {
        assert_eq!(
            troubles(&domain(inspection.clone())),
            expected,
            "{inspection:?}"
        );
    }
    let stopped = DomainFacts {
        stopped: vec![7],
        ..domain(nodes(&[live.clone(), live]))
    };
    assert_eq!(troubles(&stopped), [(Error, "process-stopped")]);
    let late = Trouble::TookTooLong(Duration::from_secs(5));
    let unclear = DomainFacts {
        inspection: Err(late.clone()),
        providers: Err(late),
        ..domain(nothing())
    };
    let expected = [(Error, "domain-unclear"), (Error, "services-unclear")];
    assert_eq!(troubles(&unclear), expected);
}

#[test]
fn what_is_not_the_domain_s_is_no_trouble() {
    let kept = Inspection {
        entries: 1,
        nodes: Vec::new(),
        strangers: vec!["/tmp/lab/letter".into()],
        management: Vec::new(),
        ..healthy()
    };
    let foreign = Inspection {
        foreign: vec![entry("/dev/shm/lab_42", false, STRANGER, 0o600)],
        ..healthy()
    };
    for (inspection, note) in [(kept, "strangers"), (foreign, "foreign-segments")] {
        let facts = domain(inspection);
        assert_eq!(troubles(&facts), []);
        let findings = diagnose(&facts, 1);
        assert!(findings.iter().any(|finding| finding.id == note), "{note}");
    }
    // What was said of a management segment is not said again.
    let twice = Inspection {
        foreign: vec![segment(STRANGER, 0o600, None).entry],
        management: vec![segment(STRANGER, 0o600, None)],
        ..healthy()
    };
    let findings = diagnose(&domain(twice), 1);
    assert!(
        findings
            .iter()
            .all(|finding| finding.id != "foreign-segments")
    );
}

#[test]
fn processes_are_named_once_and_not_without_end() {
    let many: Vec<NodeFacts> = (0..20).map(|pid| node(Life::Live, pid, "ril")).collect();
    let text = processes(&many.iter().collect::<Vec<_>>());
    assert!(
        text.starts_with("ril (process 0), ril (process 1), "),
        "{text}"
    );
    assert!(text.ends_with("12 more"), "{text}");
    let two = [node(Life::Dead, 7, ""), node(Life::Dead, 7, "")];
    assert_eq!(
        processes(&two.iter().collect::<Vec<_>>()),
        "nameless (process 7, 2 nodes)"
    );
}

#[test]
fn one_process_provides_all_of_its_services() {
    let said = |providers: &[(ServiceId, Option<Provider>)]| -> Vec<(Severity, &'static str)> {
        let findings = services(providers, 1);
        findings.iter().map(|one| (one.severity, one.id)).collect()
    };
    let all = providers([Some("bridge"), Some("status")]);
    assert_eq!(
        said(&all),
        [(Note, "service-right"), (Note, "service-right")]
    );
    let none = providers([None, None]);
    assert_eq!(
        said(&none),
        [(Note, "service-absent"), (Note, "service-absent")]
    );
    assert!(
        services(&none, 3)[0]
            .next_step
            .as_ref()
            .unwrap()
            .contains("ril bridge --robot 3")
    );

    let mut half = all.clone();
    half.retain(|(service, _)| *service != ServiceId::Movement);
    half.push((ServiceId::Movement, None));
    assert_eq!(said(&half)[0], (Warning, "service-incomplete"));
    assert!(services(&half, 1)[0].text.contains("but not movement"));
    half.pop();
    half.push((
        ServiceId::Movement,
        Some(Provider {
            pid: 99,
            process: "other".to_owned(),
            since_ns: 1,
        }),
    ));
    assert_eq!(said(&half)[0], (Warning, "service-divided"));
}

#[test]
fn memory_is_enough_for_one_more_process_or_it_is_an_error() {
    for (free, severity, text) in [
        (Ok(REQUIRED_SHM_BYTES), Note, "32 MiB free"),
        (
            Ok(REQUIRED_SHM_BYTES - 1),
            Error,
            "31 MiB free, each process needs 32 MiB",
        ),
        (
            Err(Trouble::Failed("no such folder".to_owned())),
            Error,
            "failed: no such folder",
        ),
    ] {
        let finding = memory(&free);
        assert_eq!(finding.severity, severity, "{finding:?}");
        assert!(finding.text.contains(text), "{finding:?}");
        assert_eq!(finding.next_step.is_some(), severity > Note);
    }
}
