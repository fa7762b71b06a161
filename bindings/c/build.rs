//! Names the shared library, so that programs find it by its name and not by the path at which it was built: by
//! `HERO_RIL_SONAME`, which `install.sh` sets to a name with the version.

fn main() {
    let name = std::env::var("HERO_RIL_SONAME").unwrap_or_else(|_| "libhero_ril.so".to_owned());
    println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,{name}");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=HERO_RIL_SONAME");
}
