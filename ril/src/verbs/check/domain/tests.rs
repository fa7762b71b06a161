//! Tables of what can be seen of a domain, and what is said of it.

use std::time::Duration;

use operator::robot::domain::Trouble;
use runtime::finding::Severity::{self, Error, Note, Warning};

use super::*;

/// Of a user that is not this one.
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

fn member(life: Life, pid: u32, process: &str) -> Member {
    Member {
        life,
        pid,
        process: process.to_owned(),
        service: "movement".to_owned(),
        is_tended: true,
    }
}

/// Robot 1 with these members of a service that a live process provides.
fn robot(members: &[Member]) -> RobotFacts {
    RobotFacts {
        robot: RobotId::DEFAULT,
        is_live: true,
        generations: 1,
        former: 0,
        members: members.to_vec(),
    }
}

/// A domain in which a bridge lives.
fn healthy() -> Inspection {
    Inspection {
        root: Some(entry("/dev/shm/lab", true, ours(), 0o700)),
        robots: vec![robot(&[member(Life::Live, 7, "bridge")])],
        leftovers: 0,
        entries: 23,
    }
}

fn of(robot: RobotFacts) -> Inspection {
    Inspection {
        robots: vec![robot],
        ..healthy()
    }
}

fn domain(inspection: Inspection) -> DomainFacts {
    DomainFacts {
        root: "/dev/shm/lab".into(),
        inspection: Ok(inspection),
        providers: Ok(Vec::new()),
        stopped: Vec::new(),
        others: Vec::new(),
    }
}

/// The robot after the provider of its one service has gone.
fn without_provider(robot: RobotFacts) -> RobotFacts {
    let members = robot.members.into_iter();
    RobotFacts {
        former: robot.generations,
        members: members
            .map(|member| Member {
                is_tended: false,
                ..member
            })
            .collect(),
        ..robot
    }
}

fn findings(domain: &DomainFacts) -> Vec<Finding> {
    let findings = diagnose(domain);
    for finding in &findings {
        assert!(
            finding.severity == Note || finding.next_step.is_some(),
            "no next step: {finding:?}"
        );
    }
    findings
}

fn ids(domain: &DomainFacts) -> Vec<&'static str> {
    findings(domain).iter().map(|finding| finding.id).collect()
}

/// What is not in order, by severity and name.
fn troubles(domain: &DomainFacts) -> Vec<(Severity, &'static str)> {
    findings(domain)
        .iter()
        .filter(|finding| finding.severity > Note)
        .map(|finding| (finding.severity, finding.id))
        .collect()
}

#[test]
fn what_is_in_order_gives_notes_alone() {
    let nothing = domain(Inspection::default());
    let waiting = domain(of(RobotFacts {
        generations: 0,
        ..robot(&[])
    }));
    let empty = domain(Inspection {
        robots: Vec::new(),
        entries: 1,
        ..healthy()
    });
    let healthy = domain(healthy());
    for (domain, expected) in [
        (&healthy, &["root-right", "processes"][..]),
        (&nothing, &["domain-empty"]),
        (&waiting, &["root-right", "processes"]),
        (&empty, &["root-right"]),
    ] {
        assert_eq!(ids(domain), expected, "{domain:?}");
        assert_eq!(troubles(domain), []);
    }
}

#[test]
fn each_trouble_has_its_name() {
    let root = |is_folder, uid, mode| Inspection {
        root: Some(entry("/dev/shm/lab", is_folder, uid, mode)),
        ..healthy()
    };
    let residue = RobotFacts {
        is_live: false,
        ..robot(&[member(Life::Dead, 8, "bridge")])
    };
    let unclear = [
        member(Life::Live, 7, "bridge"),
        member(Life::Unclear, 9, ""),
    ];
    #[rustfmt::skip]
    let cases: [(Inspection, &[(Severity, &str)]); 9] = [
        (root(false, ours(), 0o700), &[(Error, "root-not-a-folder")]),
        (root(true, STRANGER, 0o700), &[(Error, "root-of-another-user")]),
        (root(true, ours(), 0o777), &[(Error, "root-open")]),
        (root(true, ours(), 0o720), &[(Error, "root-open")]),
        (root(true, ours(), 0o755), &[(Warning, "root-readable")]),
        (root(true, ours(), 0o500), &[(Error, "root-closed")]),
        (of(robot(&unclear)), &[(Warning, "nodes-unclear")]),
        (of(residue), &[(Warning, "residue")]),
        (Inspection { leftovers: 2, ..healthy() }, &[(Warning, "leftovers")]),
    ];
    for (inspection, expected) in cases {
        let domain = domain(inspection);
        assert_eq!(troubles(&domain), expected, "{domain:?}");
    }
    let late = Trouble::TookTooLong(Duration::from_secs(5));
    let unclear = DomainFacts {
        inspection: Err(late),
        ..domain(healthy())
    };
    assert_eq!(troubles(&unclear), [(Error, "domain-unclear")]);
}

#[test]
fn a_stopped_process_is_reported_once_for_all_of_its_services() {
    let live = member(Life::Live, 7, "bridge");
    let other = Member {
        service: "parameters".to_owned(),
        ..live.clone()
    };
    let stopped = DomainFacts {
        stopped: vec![7],
        ..domain(of(robot(&[live, other])))
    };
    assert_eq!(troubles(&stopped), [(Error, "process-stopped")]);
}

#[test]
fn what_the_dead_left_is_trouble_only_when_it_is_not_removed() {
    let members = [
        member(Life::Live, 7, "bridge"),
        member(Life::Dead, 8, "ril"),
    ];
    let tended = domain(of(robot(&members)));
    assert_eq!(ids(&tended), ["root-right", "processes", "dead-nodes"]);
    assert_eq!(troubles(&tended), []);
    let left = domain(of(without_provider(robot(&members))));
    assert_eq!(troubles(&left), [(Warning, "dead-nodes")]);
    let findings = findings(&left);
    let finding = findings.iter().find(|one| one.id == "dead-nodes").unwrap();
    assert_eq!(
        finding.text,
        "left by dead processes of robot 1: ril (process 8)"
    );
    let next_step = finding.next_step.as_ref().unwrap();
    assert!(
        next_step.contains("`ril run bridge --robot 1`"),
        "{next_step}"
    );
    // Its generation has lost its provider.
    assert!(findings.iter().any(|one| one.id == "former-generations"));
}

#[test]
fn what_is_left_of_a_robot_names_the_processes() {
    let dead = RobotFacts {
        is_live: false,
        generations: 2,
        ..robot(&[member(Life::Dead, 8, "bridge")])
    };
    assert_eq!(
        residue(&dead).text,
        "no process of robot 1 lives; left of its shared memory: 2 generations with bridge (process 8)"
    );
    let nothing = RobotFacts {
        generations: 0,
        members: Vec::new(),
        ..dead
    };
    assert!(residue(&nothing).text.ends_with(": 0 generations"));
}

#[test]
fn what_is_not_the_domain_s_is_no_trouble() {
    let kept = domain(Inspection {
        robots: Vec::new(),
        entries: 3,
        ..healthy()
    });
    assert_eq!(ids(&kept), ["root-right", "strangers"]);
    let text = &findings(&kept)[1].text;
    assert!(
        text.starts_with("2 foreign files in /dev/shm/lab "),
        "{text}"
    );
    assert_eq!(troubles(&kept), []);
}

#[test]
fn the_domains_of_others_are_named_while_no_robot_is_alive() {
    let others = vec![
        entry("/dev/shm/hero1000", true, 1000, 0o700),
        entry("/dev/shm/lab", true, STRANGER, 0o700),
    ];
    let nothing = DomainFacts {
        others: others.clone(),
        ..domain(Inspection::default())
    };
    // The domain itself is not another one.
    assert_eq!(ids(&nothing), ["domain-empty", "domain-of-another-user"]);
    assert_eq!(troubles(&nothing), []);
    let findings = findings(&nothing);
    let [_, finding] = findings.as_slice() else {
        panic!("{findings:?}");
    };
    let text = &finding.text;
    let expected = "user 1000 has a domain at /dev/shm/hero1000";
    assert!(text.ends_with(expected), "{text}");
    let next_step = finding.next_step.as_ref().unwrap();
    assert!(next_step.contains("run as that user"), "{next_step}");
    let healthy = DomainFacts {
        others,
        ..domain(healthy())
    };
    assert_eq!(ids(&healthy), ["root-right", "processes"]);
}

#[test]
fn processes_are_named_once_and_not_without_end() {
    let many: Vec<Member> = (0..20).map(|pid| member(Life::Live, pid, "ril")).collect();
    let text = processes(&many.iter().collect::<Vec<_>>());
    assert!(
        text.starts_with("ril (process 0), ril (process 1), "),
        "{text}"
    );
    assert!(text.ends_with("12 more"), "{text}");
    let two = [member(Life::Dead, 7, ""), member(Life::Dead, 7, "")];
    assert_eq!(
        processes(&two.iter().collect::<Vec<_>>()),
        "nameless (process 7)"
    );
}
