//! The drive as a process.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ipc = ipc_types::Ipc::connect("conveyor")?;
    let mut drive = conveyor::Drive::open(&ipc)?;
    println!("ready");
    drive.run(|| false)
}
