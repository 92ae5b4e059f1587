# bokehcam for Nix: `pkgs.callPackage ./package.nix { }`, as in flake.nix. The version is that of Cargo.toml, and crates
# are those of Cargo.lock.
{ lib
, rustPlatform
, pkg-config
, python3
, patchelf
, pipewire
, dbus
, libxkbcommon
, vulkan-loader
, wayland
, xorg
}:

let
  manifest = (lib.importTOML ../../Cargo.toml).workspace.package;
  description = (lib.importTOML ../../crates/cli/Cargo.toml).package.description;

  # The libraries of packaging/libraries: loaded at run time, as Nix has no common folder for them.
  loaded = [
    dbus
    libxkbcommon
    vulkan-loader
    wayland
    xorg.libX11
    xorg.libxcb
    xorg.libXcursor
    xorg.libXi
  ];
in
rustPlatform.buildRustPackage {
  pname = "bokehcam";
  inherit (manifest) version;

  src = lib.cleanSource ../..;
  cargoLock.lockFile = ../../Cargo.lock;
  cargoBuildFlags = [ "-p" "bokehcam-cli" ];
  buildNoDefaultFeatures = true;
  buildFeatures = [ "packaged" ];

  nativeBuildInputs = [ pkg-config python3 patchelf rustPlatform.bindgenHook ];
  buildInputs = [ pipewire ];

  # The tests take an hour, and need cameras, an X server and PipeWire.
  doCheck = false;

  installPhase = ''
    runHook preInstall
    patchShebangs packaging
    packaging/install target/*/release/bokehcam "$out" /
    substituteInPlace "$out/lib/systemd/user/bokehcam.service" --replace-fail '=/bin/' "=$out/bin/"
    runHook postInstall
  '';

  postFixup = ''
    patchelf --add-rpath ${lib.makeLibraryPath loaded} "$out/bin/bokehcam"
  '';

  meta = {
    inherit description;
    license = with lib.licenses; [ mit asl20 ];
    mainProgram = "bokehcam";
    platforms = lib.platforms.linux;
  };
}
