//! Judges the providers for the doctor: which live process provides what of a robot, and whether it lives in namespaces
//! of its own.

use ipc_types::service::SERVICES;
use ipc_types::{Module, RelayModule};
use operator::robot::domain::{DomainFacts, Namespace, Provided};
use runtime::finding::Finding;

/// What the providers of `robot` mean.
pub(super) fn diagnose(domain: &DomainFacts, robot: u32) -> Vec<Finding> {
    let providers = match &domain.providers {
        Ok(providers) => providers,
        Err(trouble) => {
            return vec![Finding::error(
                "services-unclear",
                format!("looking for the providers of the domain's services {trouble}"),
                format!(
                    "stop every process of the domain, then remove {}",
                    domain.root.display()
                ),
            )];
        }
    };
    let mut findings = Vec::new();
    for command in ["bridge", "status"] {
        let of_command: Vec<&Provided> = providers
            .iter()
            .filter(|one| one.robot.get() == robot && one.service.provider() == command)
            .collect();
        findings.push(one_process(command, &of_command, robot));
        for process in distinct(&of_command) {
            findings.extend(namespaces(process));
        }
    }
    findings
}

/// What of the services that `command` provides is there. One process must provide them all.
fn one_process(command: &str, provided: &[&Provided], robot: u32) -> Finding {
    let keys = |wanted: bool| -> String {
        let of_command = SERVICES.iter().filter(|spec| spec.id.provider() == command);
        let keys: Vec<&str> = of_command
            .filter(|spec| provided.iter().any(|one| one.service == spec.id) == wanted)
            .map(|spec| spec.contract.key)
            .collect();
        keys.join(", ")
    };
    let names: Vec<String> = distinct(provided).into_iter().map(named).collect();
    let absent = keys(false);
    let is_relayed = provided
        .iter()
        .all(|one| one.by.process == RelayModule::NAME);
    match names.as_slice() {
        [name] if is_relayed => {
            // Which ones it provides is a matter of its configuration.
            let text = format!(
                "{name} provides {} of robot {robot} from another machine",
                keys(true)
            );
            Finding::note("service-relayed", text)
        }
        [] => {
            let text = format!("no {command} of robot {robot} is running");
            let finding = Finding::note("service-absent", text);
            finding.with_next_step(format!("`ril run {command} --robot {robot}` starts one"))
        }
        [name] if absent.is_empty() => {
            let text = format!("{name} provides {} of robot {robot}", keys(true));
            Finding::note("service-right", text)
        }
        [name] => {
            let text = format!(
                "{name} provides {} of robot {robot}, but not {absent}",
                keys(true)
            );
            let next_step = "look again: it may just be starting; if it stays so, restart it";
            Finding::warning("service-incomplete", text, next_step)
        }
        names => {
            let names = names.join(", ");
            let text =
                format!("what one {command} of robot {robot} should provide is divided: {names}");
            Finding::warning("service-divided", text, "keep one of them running")
        }
    }
}

/// What cannot be known of a process in other namespaces, and what goes wrong there.
fn namespaces(process: &Provided) -> Vec<Finding> {
    let mut findings = Vec::new();
    let name = named(process);
    if process.pids == Namespace::Other {
        let text = format!(
            "{name} runs where processes have other numbers, such as in a container: whether it is stopped, and what it has open, cannot be seen from here"
        );
        let finding = Finding::note("other-pid-namespace", text);
        findings.push(finding.with_next_step("to know that, run `ril doctor` there"));
    }
    if process.clock == Namespace::Other {
        let text = format!(
            "{name} runs in another time namespace: where clocks differ, the ages of its data that commands show here are wrong"
        );
        let next_step = "run all processes of the robot in one time namespace: without `unshare --time`, and in containers without clock offsets";
        findings.push(Finding::warning("other-time-namespace", text, next_step));
    }
    findings
}

/// One entry for each process.
fn distinct<'a>(provided: &[&'a Provided]) -> Vec<&'a Provided> {
    let mut processes = provided.to_vec();
    let key = |one: &&Provided| (one.by.pid, one.by.pid_namespace);
    processes.sort_by_key(key);
    processes.dedup_by_key(|one| key(one));
    processes
}

fn named(provided: &Provided) -> String {
    let (process, pid) = (&provided.by.process, provided.by.pid);
    match provided.pids {
        Namespace::Other => format!("{process} (process {pid} of another PID namespace)"),
        Namespace::Ours | Namespace::Unknown => format!("{process} (process {pid})"),
    }
}

/// The live process `name` of `robot`.
pub(super) fn process<'a>(domain: &'a DomainFacts, robot: u32, name: &str) -> Option<&'a Provided> {
    let mut providers = domain.providers.as_ref().ok()?.iter();
    providers.find(|one| one.robot.get() == robot && one.service.provider() == name)
}

/// The live bridge of `robot`, if its process id means something here.
pub fn bridge_pid(domain: &DomainFacts, robot: u32) -> Option<u32> {
    pid(domain, robot, "bridge")
}

/// The process id of the live process `name` of `robot`, if it means something here.
pub(super) fn pid(domain: &DomainFacts, robot: u32, name: &str) -> Option<u32> {
    process(domain, robot, name)
        .filter(|one| is_here(one))
        .map(|one| one.by.pid)
}

/// Whether `robot` has a live bridge whose process cannot be found here.
pub(super) fn is_bridge_elsewhere(domain: &DomainFacts, robot: u32) -> bool {
    process(domain, robot, "bridge").is_some_and(|one| !is_here(one))
}

/// Whether this process provides a bridge's services with a serial port of this machine that can be found: the bridge
/// of a relayed robot is on another machine, and the numbers of processes in another namespace mean nothing here.
fn is_here(provided: &Provided) -> bool {
    provided.pids == Namespace::Ours && provided.by.process != RelayModule::NAME
}

#[cfg(test)]
mod tests {
    use ipc_types::{Provider, RobotId, ServiceId};

    use super::*;
    use operator::robot::domain::Trouble;
    use runtime::finding::Severity::{self, Error, Note, Warning};

    fn provided(service: ServiceId, process: &str, pid: u32) -> Provided {
        Provided {
            robot: RobotId::DEFAULT,
            service,
            by: Provider {
                pid,
                process: process.to_owned(),
                since_ns: 1,
                pid_namespace: 4,
                time_namespace: 5,
            },
            pids: Namespace::Ours,
            clock: Namespace::Ours,
        }
    }

    /// A bridge and a status, whole.
    fn all() -> Vec<Provided> {
        let of = |spec: &ipc_types::service::ServiceSpec| match spec.id.provider() {
            "bridge" => provided(spec.id, "bridge", 7),
            process => provided(spec.id, process, 8),
        };
        SERVICES.iter().map(of).collect()
    }

    fn domain(providers: Vec<Provided>) -> DomainFacts {
        DomainFacts {
            root: "/dev/shm/lab".into(),
            inspection: Ok(ipc_types::inspect::Inspection::default()),
            providers: Ok(providers),
            stopped: Vec::new(),
            others: Vec::new(),
        }
    }

    fn said(providers: &[Provided], robot: u32) -> Vec<(Severity, &'static str)> {
        let findings = diagnose(&domain(providers.to_vec()), robot);
        for finding in &findings {
            assert!(
                finding.severity == Note || finding.next_step.is_some(),
                "no next step: {finding:?}"
            );
        }
        findings.iter().map(|one| (one.severity, one.id)).collect()
    }

    #[test]
    fn one_process_provides_all_of_its_services() {
        let right = (Note, "service-right");
        let absent = (Note, "service-absent");
        assert_eq!(said(&all(), 1), [right, right]);
        assert_eq!(said(&all(), 3), [absent, absent]);
        let findings = diagnose(&domain(Vec::new()), 3);
        let next_step = findings[0].next_step.as_ref().unwrap();
        assert!(
            next_step.contains("ril run bridge --robot 3"),
            "{next_step}"
        );

        let mut half = all();
        half.retain(|one| one.service != ServiceId::Movement);
        assert_eq!(said(&half, 1), [(Warning, "service-incomplete"), right]);
        let text = &diagnose(&domain(half.clone()), 1)[0].text;
        assert!(text.ends_with("but not movement"), "{text}");
        half.push(provided(ServiceId::Movement, "other", 99));
        assert_eq!(said(&half, 1), [(Warning, "service-divided"), right]);
    }

    #[test]
    fn a_relay_provides_what_it_is_configured_to() {
        let relayed = [
            provided(ServiceId::DspTelemetry, "relay", 7),
            provided(ServiceId::HeroTelemetry, "relay", 7),
        ];
        let note = (Note, "service-relayed");
        assert_eq!(said(&relayed, 1), [note, note]);
        let text = &diagnose(&domain(relayed.to_vec()), 1)[0].text;
        assert_eq!(
            text,
            "relay (process 7) provides dsp_telemetry of robot 1 from another machine"
        );
        let relayed = domain(relayed.to_vec());
        assert_eq!(bridge_pid(&relayed, 1), None);
        assert!(is_bridge_elsewhere(&relayed, 1));
        let divided = [
            provided(ServiceId::DspTelemetry, "relay", 7),
            provided(ServiceId::ModuleState, "bridge", 8),
        ];
        let absent = (Note, "service-absent");
        assert_eq!(said(&divided, 1), [(Warning, "service-divided"), absent]);
    }

    #[test]
    fn a_look_that_failed_is_an_error() {
        let mut domain = domain(Vec::new());
        domain.providers = Err(Trouble::Failed("no".to_owned()));
        let findings = diagnose(&domain, 1);
        let [finding] = findings.as_slice() else {
            panic!("{findings:?}");
        };
        assert_eq!((finding.severity, finding.id), (Error, "services-unclear"));
        assert_eq!(bridge_pid(&domain, 1), None);
    }

    #[test]
    fn a_bridge_in_other_namespaces_is_reported_once_for_all_of_its_services() {
        let mut providers = all();
        for one in &mut providers {
            if one.by.process == "bridge" {
                one.pids = Namespace::Other;
                one.clock = Namespace::Other;
            }
        }
        assert_eq!(
            said(&providers, 1),
            [
                (Note, "service-right"),
                (Note, "other-pid-namespace"),
                (Warning, "other-time-namespace"),
                (Note, "service-right"),
            ]
        );
        let elsewhere = domain(providers);
        let text = &diagnose(&elsewhere, 1)[0].text;
        let name = "bridge (process 7 of another PID namespace) provides";
        assert!(text.starts_with(name), "{text}");
        assert_eq!(bridge_pid(&elsewhere, 1), None);
        assert!(is_bridge_elsewhere(&elsewhere, 1));
        let here = domain(all());
        assert_eq!(bridge_pid(&here, 1), Some(7));
        assert!(!is_bridge_elsewhere(&here, 1) && !is_bridge_elsewhere(&here, 3));
    }

    #[test]
    fn a_provider_that_has_not_said_who_it_is_is_in_no_other_namespace() {
        let mut providers = all();
        providers[0].pids = Namespace::Unknown;
        providers[0].clock = Namespace::Unknown;
        let right = (Note, "service-right");
        assert_eq!(said(&providers, 1), [right, right]);
    }
}
