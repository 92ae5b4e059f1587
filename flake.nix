{
  description = "Portrait mode for every camera";

  inputs.nixpkgs.url = "github:NixOS/nixpkgs/nixos-unstable";

  outputs = { self, nixpkgs }:
    let
      systems = [ "x86_64-linux" "aarch64-linux" ];
      each = value: nixpkgs.lib.genAttrs systems (system: value nixpkgs.legacyPackages.${system});
    in
    {
      # `nix run`, `nix profile install`
      packages = each (pkgs: rec {
        bokehcam = pkgs.callPackage ./packaging/nix/package.nix { };
        default = bokehcam;
      });

      # `nix develop`: what the build needs, with a toolchain
      devShells = each (pkgs: {
        default = pkgs.mkShell {
          inputsFrom = [ self.packages.${pkgs.stdenv.hostPlatform.system}.bokehcam ];
          packages = [ pkgs.clippy pkgs.rustfmt ];
        };
      });
    };
}
