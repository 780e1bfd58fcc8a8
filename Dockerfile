# ROS 2 Jazzy with soilmoist_ros, as on a robot: docs/robot.md has the same steps.
#   docker build -t soilmoist_ros .
#   docker run --rm -it --network host -v "$PWD:/data" soilmoist_ros ros2 launch soilmoist_ros robot.launch.py field:=...
FROM ros:jazzy-ros-base

SHELL ["/bin/bash", "-o", "pipefail", "-c"]
WORKDIR /ws

# What rosdep and pip install changes seldom: a layer of its own.
COPY package.xml requirements-robot.txt src/soilmoist_ros/
COPY interfaces/soilmoist_msgs src/soilmoist_msgs
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3-venv \
    && rosdep update --rosdistro jazzy \
    && rosdep install --from-paths src --ignore-src -r -y \
    && rm -rf /var/lib/apt/lists/* \
    && python3 -m venv --system-site-packages .venv \
    && .venv/bin/pip install --no-cache-dir -r src/soilmoist_ros/requirements-robot.txt \
    && touch .venv/COLCON_IGNORE

COPY . src/soilmoist_ros
RUN source /opt/ros/jazzy/setup.bash \
    && .venv/bin/python -m colcon build --packages-select soilmoist_msgs soilmoist_ros

# The nodes need no rights of root.
RUN useradd --create-home --uid 1001 --groups dialout robot && install -d -o robot /data
USER 1001
WORKDIR /data
ENV PATH=/ws/install/soilmoist_ros/lib/soilmoist_ros:$PATH
# Like Ctrl-C: at a SIGTERM launch leaves its nodes, and the planner could not cancel its goal.
# A node that saves needs time: docker stop -t 150.
STOPSIGNAL SIGINT
ENTRYPOINT ["/bin/bash", "-c", "source /ws/install/setup.bash && exec \"$@\"", "--"]
CMD ["soilmoist", "--help"]
