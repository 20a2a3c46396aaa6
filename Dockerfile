# Ubuntu 24.04 with ROS 2 Jazzy from apt; for robots and for the dev container.
#   docker build -t wheel_terra .
#   docker run --rm --network host -v "$PWD":/data wheel_terra \
#     ros2 run wheel_terra_estimator estimator_node --ros-args --params-file /data/my_rover.yaml
FROM ros:jazzy-ros-base AS dev
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
WORKDIR /ws
COPY package.xml src/wheel_terra_estimator/package.xml
# What has no package for Ubuntu comes from pip, without its dependencies: never another numpy than
# the one that the messages of ROS were compiled against. Versions: requirements/oldest.txt.
# hadolint ignore=DL3008
RUN apt-get update \
    && rosdep update --rosdistro jazzy \
    && rosdep install --from-paths src --ignore-src -y \
        --skip-keys 'python3-filterpy-pip python3-rosbags-pip' \
    && apt-get install -y --no-install-recommends python3-pip \
    && rm -rf /var/lib/apt/lists/* \
    && pip install --break-system-packages --no-deps --no-cache-dir \
        apsw==3.54.1.0 backports.zstd==1.8.0 filterpy==1.4.5 lz4==4.4.5 rosbags==0.11.9 \
        ruamel.yaml==0.19.1 typing_extensions==4.16.0

FROM dev AS run
COPY . src/wheel_terra_estimator
RUN source /opt/ros/jazzy/setup.bash \
    && colcon build --packages-select wheel_terra_estimator
# Host and container share the network, but not the shared memory that Fast DDS would take.
ENV FASTDDS_BUILTIN_TRANSPORTS=UDPv4
ENTRYPOINT ["/bin/bash", "-c", "source /ws/install/setup.bash && exec \"$@\"", "--"]
CMD ["ros2", "run", "wheel_terra_estimator", "wheel-terra", "demo"]
