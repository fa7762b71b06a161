//! [`Fleet`]: a demonstration under way, of one robot or of many. One wait serves all of it.
//!
//! One robot is ordered in its own shared memory. With `--robots N` each has processes in shared memory of its own, as
//! on a machine of its own, and a relay; a station orders all of them over loopback. The air falls silent twice, one
//! robot dies and stays away, another one dies and is replaced by one with its number. Every flight is judged as that
//! of one robot is.
//!
//! The air falls silent when the robots' relays are stopped: nothing comes and nothing goes, and no relay says so.

use std::fs;
use std::net::{Ipv4Addr, TcpListener};
use std::os::fd::AsFd;
use std::path::Path;
use std::time::{Duration, Instant};

use ipc_types::code::{Functionality, LinkState, RelayLinkState};
use ipc_types::payload::ModuleState;
use ipc_types::{Descriptor, Domain, Source, Waiter, allow_many_files};
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::finding::Finding;
use runtime::signal::Termination;
use runtime::usage::Usage;
use rustix::process::Signal;

use super::checks::check;
use super::children::{ChildProcess, END_WITHIN, Readiness, Spawner};
use super::craft::{Craft, ENDS, KINDS, RELAY_CONFIG, STATION, View};
use super::options::DemoArgs;
use super::result::{DemoResult, Fate, FleetResult, RobotResult, Usages, shares};
use super::screen::Screen;
use super::script::{SCRIPT, ScriptCommand, line};

/// The commands of the script during which the air falls silent, by their places. Robots die in the second.
const SILENCES: [usize; 2] = [2, 3];

/// How long the air is silent after the station has noticed it.
const SILENCE: Duration = Duration::from_secs(2);

/// How often samples of many robots are taken, and how often the fleet looks which commands have ended. To wake for
/// each sample would cost more than all robots' processes do, and a subscriber holds those of more than a second. Of
/// commands more may be open than one wait takes.
const TICK: Duration = Duration::from_millis(50);

/// The whole demonstration ends within this and [`LIMIT_PER_ROBOT`], or something hangs. One robot takes less than 20
/// s, a fleet about two minutes; machines stall.
const LIMIT_OF_ONE: Duration = Duration::from_secs(120);
const LIMIT_OF_FLEET: Duration = Duration::from_secs(300);

/// For each robot of a fleet: twenty of them share two processors on small machines.
const LIMIT_PER_ROBOT: Duration = Duration::from_secs(30);

/// Processes that start at once. The kernel holds ten messages for a socket that is not read meanwhile
/// (`net.unix.max_dgram_qlen`) and drops further ones: a process whose message is lost would never count as ready.
const STARTING: usize = 8;

/// A demonstration under way: its robots' processes, its station, and how far each robot has flown.
pub(super) struct Fleet<'a> {
    args: &'a DemoArgs,
    folder: &'a Path,
    termination: &'a Termination,
    readiness: Readiness,
    waiter: Waiter,
    /// What is shown meanwhile.
    screen: Screen,
    /// Processes that were started and say when they are ready, and how many have.
    started: usize,
    ready: usize,
    crafts: Vec<Craft>,
    /// Who orders many robots.
    station: Option<Station>,
    began: Instant,
    limit: Duration,
}

/// The station's machine.
struct Station {
    domain: Domain,
    relay: Option<ChildProcess>,
    /// What it sees, by the robots' numbers from 1.
    views: Vec<View>,
}

impl Station {
    fn link(&self, number: u32) -> Option<RelayLinkState> {
        self.views[number as usize - 1].last_link?.state()
    }

    fn bytes_received(&self) -> u64 {
        let links = self.views.iter().filter_map(|view| view.last_link);
        links.map(|link| link.bytes_received).sum()
    }
}

impl<'a> Fleet<'a> {
    /// Nothing is started yet.
    pub fn new(
        args: &'a DemoArgs,
        folder: &'a Path,
        termination: &'a Termination,
    ) -> Result<Fleet<'a>, Failure> {
        let station = || Station {
            domain: Domain::isolated(),
            relay: None,
            views: Vec::new(),
        };
        Ok(Fleet {
            args,
            folder,
            termination,
            readiness: Readiness::new().or_fail(ExitCode::Internal)?,
            waiter: Waiter::new(),
            screen: Screen::new(args.json),
            started: 0,
            ready: 0,
            crafts: Vec::new(),
            station: args.robots.map(|_| station()),
            began: Instant::now(),
            limit: match args.robots {
                None => LIMIT_OF_ONE,
                Some(robots) => LIMIT_OF_FLEET + LIMIT_PER_ROBOT * robots,
            },
        })
    }

    /// Lets `fly` fly it, with everything but the folder cleaned up in any case. Gives its result, and how many things
    /// are left at the station.
    pub fn demonstrate<T>(
        mut self,
        fly: impl FnOnce(&mut Fleet<'a>) -> Result<T, Failure>,
    ) -> Result<(T, usize), Failure> {
        let flown = fly(&mut self);
        let shown = self.screen.end();
        // After an error too: what orders ends before what it orders.
        let domains = self.end_at_once();
        for domain in &domains {
            domain.remove_if_dead().map_err(Failure::internal)?;
        }
        let result = flown?;
        shown?;
        let residues = domains.iter().map(|domain| domain.residue().len());
        Ok((result, residues.sum()))
    }

    /// One robot flies the script.
    pub fn fly_one(&mut self) -> Result<DemoResult, Failure> {
        self.screen.line(
            "starting the simulator, status, the recorder and the bridge as processes of their own",
        )?;
        let craft = Craft::new(self.args.robot.get(), self.folder.to_owned(), None)?;
        self.crafts.push(craft);
        self.start_from(0)?;
        self.await_seen(0)?;
        let began = Instant::now();
        for command in SCRIPT {
            let text = line(command);
            self.screen.order = Some(text.clone());
            self.say(6, began, &text)?;
            self.order(0, command)?;
            self.until("the command has ended", Fleet::no_orders)?;
            let flown = &self.crafts[0].flown;
            let (said, has_failed) = (flown.said.clone(), flown.order_failed.is_some());
            self.say(6, began, &said)?;
            if has_failed {
                break;
            }
        }
        let took = began.elapsed();
        self.end_processes()?;
        let craft = &mut self.crafts[0];
        let residue = craft.leave()?;
        let files = craft.files();
        Ok(DemoResult {
            checks: craft.judge(&files, residue),
            ages_ms: [50, 99].map(|percentile| craft.flown.seen.age_ms(percentile)),
            took,
            files,
        })
    }

    /// Many robots fly the script.
    pub fn fly_many(&mut self, robots: u32) -> Result<FleetResult, Failure> {
        allow_many_files();
        let began = self.began;
        let text = format!("starting {robots} robots, each with a relay, and a station");
        self.say(7, began, &text)?;
        self.start(robots)?;
        let (before, flight) = (self.usages(), Instant::now());
        let bytes_before = self.station.as_ref().map_or(0, Station::bytes_received);
        let mut silences = Vec::new();
        for (place, command) in SCRIPT.into_iter().enumerate() {
            self.say(7, began, &format!("{}, to all robots", line(command)))?;
            self.until("every link is up", Fleet::all_links_up)?;
            (0..self.crafts.len()).try_for_each(|at| self.order(at, command))?;
            if SILENCES.contains(&place) {
                self.until("every robot follows its path", Fleet::all_follow)?;
                if place == SILENCES[1] {
                    let text = format!("robots {} and {robots} die", robots - 1);
                    self.say(7, began, &text)?;
                    let dying = &mut self.crafts[robots as usize - 2..];
                    dying.iter_mut().for_each(Craft::kill);
                }
                self.say(7, began, "the air falls silent")?;
                silences.push(self.silence()?);
                self.say(7, began, "every link is back")?;
            }
            self.until("every command has ended", Fleet::no_orders)?;
        }
        let elapsed = flight.elapsed();
        let shares = shares(&before, &self.usages());
        let station = self.station.as_ref();
        let bytes = station.map_or(0, Station::bytes_received) - bytes_before;
        // The one that stays away is the last one.
        let lost = station.and_then(|station| station.link(robots));
        let text = format!(
            "another robot {} takes the place of the dead one",
            robots - 1
        );
        self.say(7, began, &text)?;
        let replacement = self.replace(robots - 1)?;
        for command in SCRIPT {
            self.until("every link is up", Fleet::all_links_up)?;
            self.order(replacement, command)?;
            self.until("the command has ended", Fleet::no_orders)?;
        }
        self.say(7, began, "all processes end")?;
        let relay = self.station.as_mut().and_then(|one| one.relay.take());
        let exits = self.end(relay.into_iter().collect())?;
        let checks = self.judge(&silences, lost, exits.into_iter().next().flatten());
        Ok(FleetResult {
            bytes_per_s: bytes as f64 / elapsed.as_secs_f64() / f64::from(robots),
            robots: self.end_robots(robots, replacement)?,
            checks,
            shares,
            took: began.elapsed(),
        })
    }

    /// A line that stays, with the time since `began` in so many places.
    fn say(&mut self, places: usize, began: Instant, text: &str) -> Result<(), Failure> {
        let seconds = began.elapsed().as_secs_f64();
        self.screen.line(&format!("{seconds:places$.2} s  {text}"))
    }

    /// Starts everything, and returns when every robot is seen at the station.
    fn start(&mut self, robots: u32) -> Result<(), Failure> {
        let endpoints = free_endpoints(robots).or_fail(ExitCode::Internal)?;
        for (number, endpoint) in (1..).zip(&endpoints) {
            let folder = self.folder.join(format!("robot-{number}"));
            self.crafts
                .push(Craft::new(number, folder, Some(endpoint))?);
        }
        self.start_from(0)?;
        self.start_station(&endpoints)?;
        self.await_seen(0)
    }

    /// Starts the processes of the robots from this place on, all of a kind at once.
    fn start_from(&mut self, from: usize) -> Result<(), Failure> {
        let kinds = match self.station {
            None => &KINDS[..KINDS.len() - 1],
            Some(_) => &KINDS,
        };
        for kind in kinds {
            for at in from..self.crafts.len() {
                self.until("processes are ready", |fleet| {
                    fleet.started < fleet.ready + STARTING
                })?;
                self.started += 1;
                self.crafts[at].start(kind, self.args.speed, &self.readiness)?;
            }
            self.until_ready()?;
        }
        Ok(())
    }

    /// Returns when the robots from this place on are seen by who orders them, with their paths planned.
    fn await_seen(&mut self, from: usize) -> Result<(), Failure> {
        self.until("every robot is seen", |fleet| {
            let mut crafts = fleet.crafts[from..].iter();
            crafts.all(|craft| craft.flown.seen.home.is_some()) && fleet.all_links_up()
        })?;
        let mut crafts = self.crafts[from..].iter_mut();
        crafts.try_for_each(Craft::plan_paths)
    }

    fn until_ready(&mut self) -> Result<(), Failure> {
        self.until("every process is ready", |fleet| {
            fleet.ready >= fleet.started
        })
    }

    fn start_station(&mut self, endpoints: &[String]) -> Result<(), Failure> {
        let Some(station) = &mut self.station else {
            return Ok(());
        };
        let folder = self.folder.join("station");
        fs::create_dir_all(&folder).or_fail(ExitCode::Internal)?;
        let spawner = Spawner {
            domain: &station.domain,
            robot: 1,
            folder: &folder,
            readiness: &self.readiness,
        };
        let numbers = (1..).zip(endpoints).map(|(number, _)| number);
        let robots: Vec<String> = numbers
            .clone()
            .map(|number| format!("{{ number = {number} }}"))
            .collect();
        let connect: Vec<String> = endpoints.iter().map(|one| format!("{one:?}")).collect();
        let config = format!(
            "[station]\nname = {STATION:?}\nconnect = [{}]\nrobots = [{}]\n{RELAY_CONFIG}",
            connect.join(", "),
            robots.join(", ")
        );
        fs::write(spawner.config_file("relay"), config).or_fail(ExitCode::Internal)?;
        for number in numbers {
            station.views.push(View::new(number, &station.domain)?);
        }
        station.relay = Some(spawner.start_relay("station", &[])?);
        self.started += 1;
        self.until_ready()
    }

    /// Gives a command to a robot that has carried out those before.
    fn order(&mut self, at: usize, command: ScriptCommand) -> Result<(), Failure> {
        // A busy machine takes long to start a process: subscribers hold what comes while one starts, but not while
        // twenty do.
        self.serve()?;
        let (craft, station) = (&mut self.crafts[at], self.station.as_ref());
        match craft.flown.order_failed.is_some() || craft.is_dead() {
            true => Ok(()),
            false => craft.order(command, station.map(|one| &one.domain), &self.readiness),
        }
    }

    fn no_orders(&mut self) -> bool {
        // All are asked: each takes down how its command ended.
        let open = self
            .crafts
            .iter_mut()
            .map(|craft| usize::from(!craft.has_order_ended()));
        open.sum::<usize>() == 0
    }

    /// Whether each robot follows its path, or has done so already.
    fn all_follow(&mut self) -> bool {
        let mut all = true;
        for craft in &mut self.crafts {
            let doing = craft
                .flown
                .seen
                .state
                .as_ref()
                .and_then(|state| state.functionality());
            all &= doing == Some(Functionality::FollowingPath) || craft.has_order_ended();
        }
        all
    }

    /// Whether each robot that lives is seen by who orders it, and sees its DSP.
    fn all_links_up(&mut self) -> bool {
        let is_dsp_up = |state: Option<&ModuleState>| {
            state.is_some_and(|state| state.link.state() == Some(LinkState::Up))
        };
        let mut living = self.crafts.iter().filter(|craft| !craft.is_dead());
        living.all(|craft| match &self.station {
            None => is_dsp_up(craft.flown.seen.state.as_ref()),
            Some(station) => {
                let view = &station.views[craft.number as usize - 1];
                station.link(craft.number) == Some(RelayLinkState::Up)
                    && is_dsp_up(view.last_state.as_ref())
            }
        })
    }

    /// Stops all relays of robots until the station has noticed it, and some time longer. Returns how many links were
    /// seen to go down and come back.
    fn silence(&mut self) -> Result<usize, Failure> {
        let signal = |fleet: &Fleet<'_>, signal| {
            let relays = fleet.crafts.iter().filter_map(Craft::relay);
            relays.for_each(|relay| relay.signal(signal));
        };
        signal(self, Signal::STOP);
        let noticed = self.until("the station notices the silence", |fleet| {
            let mut living = fleet.crafts.iter().filter(|craft| !craft.is_dead());
            living.all(|craft| {
                let station = fleet.station.as_ref();
                let link = station.and_then(|station| station.link(craft.number));
                link == Some(RelayLinkState::Down)
            })
        });
        let end = Instant::now() + SILENCE;
        let waited = noticed.and_then(|()| self.until("the silence", |_| Instant::now() >= end));
        signal(self, Signal::CONT);
        waited?;
        self.until("every link is back", Fleet::all_links_up)?;
        Ok(self.crafts.iter().filter(|craft| !craft.is_dead()).count())
    }

    /// Starts another robot with the number of a dead one. Returns its place.
    fn replace(&mut self, number: u32) -> Result<usize, Failure> {
        let endpoint = self.crafts[number as usize - 1].endpoint();
        let folder = self.folder.join(format!("robot-{number}-replacement"));
        let craft = Craft::new(number, folder, endpoint)?;
        let at = self.crafts.len();
        self.crafts.push(craft);
        self.start_from(at)?;
        self.await_seen(at)?;
        Ok(at)
    }

    /// Ends every robot, and judges it. `replacement` is the place of the one that came later.
    fn end_robots(&mut self, robots: u32, replacement: usize) -> Result<Vec<RobotResult>, Failure> {
        let fates: Vec<Fate> = (0..)
            .zip(&self.crafts)
            .map(|(at, craft)| match craft.is_dead() {
                true if craft.number == robots => Fate::Died,
                true => Fate::Replaced,
                false if at == replacement => Fate::Replacement,
                false => Fate::Flew,
            })
            .collect();
        self.end_processes()?;
        let residues = self.crafts.iter_mut().map(Craft::leave);
        let residues: Vec<usize> = residues.collect::<Result<_, _>>()?;
        let crafts = std::mem::take(&mut self.crafts);
        let robots = crafts.iter().zip(fates).zip(residues);
        let judged = robots.map(|((craft, fate), residue)| RobotResult {
            number: craft.number,
            fate,
            checks: match fate {
                Fate::Died | Fate::Replaced => of_dead(craft, residue),
                Fate::Flew | Fate::Replacement => craft.judge(&craft.files(), residue),
            },
        });
        let mut results: Vec<_> = judged.collect();
        results.sort_by_key(|robot| (robot.number, robot.fate));
        Ok(results)
    }

    /// Ends the processes of all robots in the order of the data, so that no sample is missed: all of a kind at once.
    /// Takes down their exit codes.
    fn end_processes(&mut self) -> Result<(), Failure> {
        for kind in ENDS {
            let (places, processes): (Vec<_>, _) = self.take_processes(kind).into_iter().unzip();
            for (at, code) in places.into_iter().zip(self.end(processes)?) {
                self.crafts[at].flown.exits.push((kind, code));
            }
        }
        Ok(())
    }

    /// All robots' processes of this kind, each with the place of its robot. From here on they may end.
    fn take_processes(&mut self, kind: &str) -> Vec<(usize, ChildProcess)> {
        let crafts = self.crafts.iter_mut().enumerate();
        let taken = crafts.filter_map(|(at, craft)| Some((at, craft.take_process(kind)?)));
        taken.collect()
    }

    /// Ends these, all at once, and takes samples until they have ended: some take seconds. One that takes too long is
    /// killed. Returns their exit codes, in their order.
    fn end(&mut self, mut processes: Vec<ChildProcess>) -> Result<Vec<Option<i32>>, Failure> {
        processes.iter().for_each(ChildProcess::ask_to_end);
        let limit = Instant::now() + END_WITHIN;
        self.until("processes have ended", |_| {
            Instant::now() >= limit || processes.iter_mut().all(ChildProcess::has_ended)
        })?;
        // Those that have ended do not get it.
        processes.iter().for_each(|one| one.signal(Signal::KILL));
        Ok(processes.iter_mut().map(ChildProcess::end).collect())
    }

    /// What is judged of the fleet as a whole.
    fn judge(
        &self,
        silences: &[usize],
        lost: Option<RelayLinkState>,
        exit: Option<i32>,
    ) -> Vec<Finding> {
        let views = self.station.as_ref().map_or(&[][..], |one| &one.views);
        let own: u64 = views.iter().map(|view| view.own).sum();
        let foreign: u64 = views.iter().map(|view| view.foreign).sum();
        let sent = views.iter().filter_map(|view| view.last_link);
        let sent: u64 = sent.map(|link| link.orders_sent).sum();
        let links: Vec<String> = silences.iter().map(usize::to_string).collect();
        vec![
            check(
                "links back after each silence",
                silences.len() == SILENCES.len(),
                format!("{} links", links.join(" and ")),
            ),
            check(
                "each robot's telemetry is its own",
                foreign == 0 && views.iter().all(|view| view.own > 0),
                format!("{own} samples at the station, {foreign} of another robot"),
            ),
            check(
                "a lost robot is shown as lost",
                lost == Some(RelayLinkState::Down),
                format!(
                    "robot {}: link {}",
                    views.len(),
                    lost.map_or("unknown", |link| link.name())
                ),
            ),
            check(
                "the station ended with 0",
                exit == Some(0),
                format!("{sent} requests sent"),
            ),
        ]
    }

    /// Of each process that lives, by kind and number.
    fn usages(&self) -> Usages {
        let processes = self.crafts.iter().flat_map(|craft| &craft.processes);
        let of_robots = processes.map(|process| (process.name(), process.id()));
        let station = self.station.iter().flat_map(|station| &station.relay);
        let station = station.map(|relay| ("station", relay.id()));
        let all = of_robots.chain(station);
        all.filter_map(|(kind, id)| Some(((kind, id), Usage::of(id).ok()?)))
            .collect()
    }

    /// Serves everything until `done`, which is `what`. Ends early as [`Fleet::serve`] does, or when time runs out.
    fn until(
        &mut self,
        what: &str,
        mut done: impl FnMut(&mut Self) -> bool,
    ) -> Result<(), Failure> {
        loop {
            self.serve()?;
            if done(self) {
                return Ok(());
            }
            if self.began.elapsed() >= self.limit {
                let text = format!("not within {}: {what}", DurationText(self.limit));
                return Err(Failure::new(ExitCode::Timeout, text));
            }
            self.sleep()?;
        }
    }

    /// Takes everything that has come, without waiting, and shows one robot. Fails when a signal came or a process has
    /// ended by itself.
    fn serve(&mut self) -> Result<(), Failure> {
        self.ready += self.readiness.drain();
        self.crafts.iter_mut().try_for_each(Craft::drain)?;
        let views = self.station.iter_mut().flat_map(|one| &mut one.views);
        views.into_iter().try_for_each(View::drain)?;
        if let (None, [craft]) = (&self.station, self.crafts.as_slice()) {
            self.screen.draw(&craft.flown.seen)?;
        }
        let of_robots = self.crafts.iter_mut().flat_map(|craft| {
            let number = craft.number;
            let processes = craft.processes.iter_mut();
            processes.map(move |process| (number, process))
        });
        let station = self.station.iter_mut().flat_map(|one| &mut one.relay);
        let station = station.map(|relay| (0, relay));
        let mut ended = of_robots
            .chain(station)
            .filter_map(|(number, process)| process.has_ended().then_some((number, process)));
        let ended = ended.next();
        // Asked after that: a signal to the process group may have ended a process that had no group of its own yet.
        goes_on(self.termination)?;
        let Some((number, process)) = ended else {
            return Ok(());
        };
        let (name, code) = (process.name(), process.end());
        let whose = match number {
            0 => "the station".to_owned(),
            number => format!("robot {number}"),
        };
        Err(Failure::internal(format!(
            "the process {name} of {whose} ended by itself with code {code:?}; its last words:\n{}",
            process.last_words()
        )))
    }

    /// Waits for signals and processes that are ready; of one robot for everything else too, because its samples' ages
    /// are measured.
    fn sleep(&mut self) -> Result<(), Failure> {
        let mut descriptors = vec![
            Descriptor::new(self.termination.as_fd()),
            Descriptor::new(self.readiness.as_fd()),
        ];
        let mut ports = Vec::new();
        if let (None, [craft]) = (&self.station, self.crafts.as_mut_slice()) {
            let (samples, processes) = craft.sources();
            ports = samples;
            descriptors.extend(processes.map(|process| Descriptor::new(process.as_fd())));
        }
        let descriptors = descriptors.iter_mut().map(|one| one as &mut dyn Source);
        let sources = ports.into_iter().chain(descriptors);
        let mut sources: Vec<_> = sources.map(|source| ((), source)).collect();
        let waited = self.waiter.wait(&mut sources, Some(TICK));
        waited.map_err(Failure::internal)?;
        Ok(())
    }

    /// Ends what lives: the orders, then the station, then the robots. Returns the shared memory, whose last users they
    /// were.
    fn end_at_once(&mut self) -> Vec<Domain> {
        self.crafts.iter_mut().for_each(|craft| craft.order = None);
        let station = self.station.take().map(|station| station.domain);
        for kind in ENDS {
            // What they end with is not judged: each has ended when it is dropped.
            let processes = self.take_processes(kind);
            processes
                .iter()
                .for_each(|(_, process)| process.ask_to_end());
        }
        let crafts = self.crafts.drain(..).map(|craft| craft.domain);
        crafts.chain(station).collect()
    }
}

/// Ends a demonstration early when a signal has come.
fn goes_on(termination: &Termination) -> Result<(), Failure> {
    if !termination.requested() {
        return Ok(());
    }
    let text = "interrupted; nothing is left running";
    Err(match termination.signal() {
        Some(signal) => Failure::interrupted(signal, text),
        None => Failure::internal(text),
    })
}

/// What is judged of a robot that was killed on its way.
fn of_dead(craft: &Craft, residue: usize) -> Vec<Finding> {
    let failed = craft.flown.order_failed.as_deref();
    vec![
        check(
            "its last order did not succeed",
            failed.is_some(),
            failed.unwrap_or("it says that it was done").to_owned(),
        ),
        check(
            "nothing left in shared memory",
            residue == 0,
            format!("{residue} files and segments left"),
        ),
    ]
}

/// Endpoints on loopback, all different, that no other process has and hardly one takes until the relays listen there,
/// or again when one is replaced.
fn free_endpoints(count: u32) -> std::io::Result<Vec<String>> {
    let address = own_loopback(std::process::id());
    let listeners: Vec<_> = (0..count)
        .map(|_| TcpListener::bind((address, 0)))
        .collect::<Result<_, _>>()?;
    let endpoint = |listener: &TcpListener| Ok(format!("tcp/{}", listener.local_addr()?));
    listeners.iter().map(endpoint).collect()
}

/// An address on loopback that belongs to this process: on 127.0.0.1 the kernel gives a port that is free now to the
/// next program that connects or listens there.
fn own_loopback(process: u32) -> Ipv4Addr {
    // The kernel numbers processes up to 2^22, so that the network's last address, which is a broadcast, is not
    // reached.
    Ipv4Addr::from_bits(0x7f80_0000 | process & 0x003f_ffff)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn each_process_has_an_address_of_its_own_on_loopback() {
        let addresses: BTreeSet<_> = [1, 2, 256, 4_194_303].map(own_loopback).into();
        assert_eq!(addresses.len(), 4);
        let usual = |address: &Ipv4Addr| *address == Ipv4Addr::LOCALHOST || address.is_broadcast();
        assert!(addresses.iter().all(Ipv4Addr::is_loopback));
        assert!(!addresses.iter().any(usual));
        let endpoints: BTreeSet<_> = free_endpoints(50).unwrap().into_iter().collect();
        assert_eq!(endpoints.len(), 50);
    }
}
